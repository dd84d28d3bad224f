"""Scores of views from all around, where no photograph shows what should be seen there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.orbit import moved_around
from mocoflow_core.io.pictures import as_bytes
from mocoflow_core.methods.rendered_views import Renderer
from mocoflow_core.methods.scored_views import Subject
from mocoflow_core.metrics.crop import Crop, crop_around
from mocoflow_core.metrics.orbit_agreement import LEAST_VIEWS, residuals_mm
from mocoflow_core.metrics.person_judge import PersonJudge, PersonScoreConfig
from mocoflow_core.metrics.score import WHITE
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.views import spread_frames
from mocoflow_core.perception.person import Keypoints, Picture

ORBIT = "orbit"
PLAUSIBILITY, RESIDUAL = "plausibility", "orbit_residual_mm"


class Ring(NamedTuple):
    """Cameras all around the body at one moment."""

    frame_index: int
    cameras: list[Camera]


class Square(NamedTuple):
    """The square around the rendered person that the detectors look at."""

    side: int  # pixels, as for the other scores
    opaque: float  # A rendered pixel above this opacity is the person.

    def of(self, rgb: NDArray[np.floating], opacity: NDArray[np.floating]) -> Seen:
        """The square of a render (H, W, 3) over white."""
        mask = opacity > self.opaque
        if not mask.any():
            return Seen(None, np.full((self.side, self.side, 3), 255, np.uint8))
        crop = crop_around(mask, self.side)
        return Seen(crop, as_bytes(crop.of(rgb, WHITE)))


class Seen(NamedTuple):
    """A render cut to its person; ``crop`` is None where nothing was rendered."""

    crop: Crop | None
    picture: Picture


def orbit_rows(
    subject: Subject,
    renderers: Mapping[str, Renderer],
    rings: Sequence[Ring],
    square: Square,
    configuration: PersonScoreConfig,
    judge: PersonJudge,
) -> list[ScoreRow]:
    """``plausibility`` of every view, and ``orbit_residual_mm`` of every moment, by method.

    The residual says how far the keypoints found in the views of one moment are from being the
    projections of common points: a mean over the keypoints that enough views show. A moment
    without any has none.
    """
    protocols = _protocols(rings, square.side, configuration, judge)
    rows = []
    for method, renderer in renderers.items():
        for ring in rings:
            seen = [square.of(*renderer.render(c, ring.frame_index)) for c in ring.cameras]
            sights = judge.look([one.picture for one in seen])
            poses = [_in_view(s.pose, one.crop) for s, one in zip(sights, seen, strict=True)]
            residuals = residuals_mm(ring.cameras, poses, configuration.keypoint_confidence)
            values = [(PLAUSIBILITY, float(sight.person)) for sight in sights]
            if np.isfinite(residuals).any():
                values.append((RESIDUAL, float(np.nanmean(residuals))))
            where = (subject.scene, method, subject.seed, ORBIT, ring.frame_index)
            rows += [ScoreRow(*where, name, value, protocols[name]) for name, value in values]
    return rows


def rings_around(
    camera: Camera,
    frame_indices: NDArray[np.integer],
    meshes: MeshSequence,
    up: ArrayLike,
    configuration: PersonScoreConfig,
) -> list[Ring]:
    """The train camera carried around the body's middle, at moments spread over the clip."""
    known = np.intersect1d(frame_indices, meshes.frame_indices)
    moments = spread_frames(known, configuration.orbit_moments)
    bodies = meshes.at(np.array(moments))
    return [
        Ring(frame, list(_carried(camera, vertices, up, configuration.orbit_views)))
        for frame, vertices in zip(moments, bodies.vertices, strict=True)
    ]


def _carried(
    camera: Camera, vertices: NDArray[np.floating], up: ArrayLike, count: int
) -> Iterator[Camera]:
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    for number in range(count):
        angle = 2.0 * np.pi * number / count
        yield moved_around(camera, angle * np.asarray(up, np.float64), middle)


def _in_view(pose: Keypoints | None, crop: Crop | None) -> Keypoints | None:
    """A pose of the crop as one of the whole view."""
    if pose is None or crop is None:
        return None
    corner = np.array([crop.left, crop.top], np.float32)
    return Keypoints(pose.places + corner, pose.confidence)


def _protocols(
    rings: Sequence[Ring], side: int, configuration: PersonScoreConfig, judge: PersonJudge
) -> dict[str, str]:
    around = (
        f"no other camera: {configuration.orbit_views} views around the body at each of "
        f"{len(rings)} moments, none with a photograph; square of {side} px around the rendered "
        "person on white"
    )
    return {
        PLAUSIBILITY: f"{around}; {judge.plausibility_protocol()}",
        RESIDUAL: f"{around}; each keypoint that at least {LEAST_VIEWS} views of a moment show "
        f"with a confidence from {configuration.keypoint_confidence:g} is triangulated, its "
        "reprojection residual carried to its depth; mean over views and keypoints; "
        f"{judge.keypoints_name()}",
    }
