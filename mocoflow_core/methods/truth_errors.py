"""Did the optimisation repair the estimate? Distances to the truth, before and after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rigid_controls import rigid_controls
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.body_lattices import (
    BodyMotionConfig,
    build_body_motion,
    canonical_nodes,
)
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.methods.rendered_views import TrainedRenderer
from mocoflow_core.methods.scored_views import Subject
from mocoflow_core.methods.truth_file import read_truth
from mocoflow_core.metrics.consensus import consensus_global_mm, consensus_local_mm
from mocoflow_core.metrics.correspondence import correspondence_mm, draw_pairs
from mocoflow_core.metrics.keypoints import (
    KeypointErrors,
    carried_keypoints,
    keypoint_errors,
    regress_keypoints,
)
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.views import spread_frames
from mocoflow_core.training.pretrain_density import DensityConfig, pretrain_density

Points = NDArray[np.float64]


class TruthConfig(ConfigurationPart):
    """How many frames, points and pairs of frames the distances are taken over."""

    frames: int = Field(16, ge=2, description="At most so many frames, spread over the clip.")
    points: int = Field(400, ge=1, description="Surface points, evenly spread over the vertices.")
    pairs_per_frame: int = Field(2, ge=1, description="Other frames each frame is reached from.")
    seed: int = Field(0, ge=0, description="Draws the pairs.")
    # As far as the widest shell reaches.
    reach_m: float = Field(
        0.15, gt=0, description="How far from the given mesh its motion is known, metres."
    )
    spreading: BodyMotionConfig = BodyMotionConfig()


class GivenMotion:
    """The motion of the given meshes, spread into space: what there was before."""

    def __init__(self, clip: Clip, given: MeshSequence, configuration: TruthConfig) -> None:
        """``given`` at the clip's frames, as they came."""
        self._rows = {int(index): row for row, index in enumerate(clip.frame_indices)}
        self._reach_m, self._body_config = configuration.reach_m, configuration.spreading
        density = pretrain_density(given, int(clip.frame_indices[0]), DensityConfig())
        self._prior = density.prior()
        self._controls = rigid_controls(
            density.vertices,
            given.vertices,
            given.faces,
            clip.times,
            self._body_config.control_spacing_m,
            self._body_config.neighbours,
        )
        self._canonical = canonical_nodes(self._controls, self._reach_m, self._body_config)
        self._bodies: dict[int, BodyMotion] = {}

    def to_canonical(self, points: Points, frame_index: int) -> Points:
        row = torch.zeros(len(points), dtype=torch.int64)
        return _array(self._body(frame_index).to_canonical(_tensor(points), row)[0])

    def to_observed(self, points: Points, frame_index: int) -> Points:
        row = torch.zeros(len(points), dtype=torch.int64)
        return _array(self._body(frame_index).to_observed(_tensor(points), row)[0])

    def _body(self, frame_index: int) -> BodyMotion:
        if frame_index not in self._bodies:
            self._bodies[frame_index] = build_body_motion(
                self._controls.frames(np.array([self._rows[frame_index]])),
                self._prior,
                self._reach_m,
                self._body_config,
                self._canonical,
            )
        return self._bodies[frame_index]


@dataclass(frozen=True)
class LearnedMotion:
    """The optimised motion."""

    renderer: TrainedRenderer

    def to_canonical(self, points: Points, frame_index: int) -> Points:
        row = torch.zeros(len(points), dtype=torch.int64)
        return _array(self.renderer.at(frame_index).to_canonical(_tensor(points), row)[0])

    def to_observed(self, points: Points, frame_index: int) -> Points:
        row = torch.zeros(len(points), dtype=torch.int64)
        return _array(self.renderer.at(frame_index).to_observed(_tensor(points), row)[0])


Motion = GivenMotion | LearnedMotion


def motion_rows(
    subject: Subject,
    renderer: TrainedRenderer,
    clip: Clip,
    meshes: MeshSequence,
    canonical_vertices: NDArray[np.float32],
    truth: Path | None,
    configuration: TruthConfig,
) -> list[ScoreRow]:
    """Errors of the motion over the clip, of the given body's (as ``posed_mesh``) and ours.

    ``consensus_local_mm`` and ``consensus_global_mm`` need no truth; the distances to the truth
    appear where it holds vertices or keypoints. All rows stand under the train camera's name.
    """
    before = GivenMotion(clip, meshes.at(clip.frame_indices), configuration)
    learned = LearnedMotion(renderer)
    chosen = spread_frames(clip.frame_indices, configuration.frames)
    clip = clip.at_rows(np.isin(clip.frame_indices, chosen))
    given = meshes.at(clip.frame_indices)
    canonical = canonical_vertices.astype(np.float64)
    placed = np.stack([learned.to_observed(canonical, int(i)) for i in clip.frame_indices])
    states = (
        ("posed_mesh", before, given.vertices.astype(np.float64)),
        ("mocoflow", learned, placed),
    )
    rows = []
    for method, motion, vertices in states:
        measured = [*_consensus(motion, clip, vertices, configuration)]
        if truth is not None:
            measured += _against_truth(
                motion, clip, vertices, given.keypoint_regressor, truth, configuration
            )
        rows += [
            ScoreRow(
                subject.scene,
                method,
                subject.seed,
                clip.camera.name,
                frame_index,
                metric,
                value,
                _protocol(configuration),
            )
            for metric, frame_index, value in measured
            if np.isfinite(value)
        ]
    return rows


Measured = tuple[str, int, float]  # metric, frame_index, value


def _consensus(
    motion: Motion, clip: Clip, vertices: Points, configuration: TruthConfig
) -> Iterator[Measured]:
    """Over points on the body (T, V, 3), each frame with one drawn partner."""
    partner = {end: start for start, end in draw_pairs(clip.frame_indices, 1, configuration.seed)}
    for row, frame_index in enumerate(clip.frame_indices.tolist()):
        points = _spread(vertices[row], configuration.points)
        maps = (motion.to_canonical, motion.to_observed)
        yield "consensus_local_mm", frame_index, consensus_local_mm(points, frame_index, *maps)
        if frame_index in partner:
            value = consensus_global_mm(points, frame_index, partner[frame_index], *maps)
            yield "consensus_global_mm", frame_index, value


def _against_truth(
    motion: Motion,
    clip: Clip,
    vertices: Points,
    regressor: NDArray[np.float32] | None,
    truth: Path,
    configuration: TruthConfig,
) -> list[Measured]:
    arrays = read_truth(truth)
    frames, known, ours = np.intersect1d(
        arrays["frame_indices"], clip.frame_indices, return_indices=True
    )
    if not len(frames):
        return []
    measured: list[Measured] = []
    pairs = draw_pairs(frames, configuration.pairs_per_frame, configuration.seed)
    maps = (motion.to_canonical, motion.to_observed)
    if "vertices" in arrays and pairs:
        points = _spread(arrays["vertices"][known].astype(np.float64), configuration.points)
        values = correspondence_mm(points, frames, pairs, *maps)
        measured += [
            ("correspondence_mm", end, float(value))
            for (_, end), value in zip(pairs, values, strict=True)
        ]
    if "keypoints3d" in arrays:
        keypoints = arrays["keypoints3d"][known].astype(np.float64)
        if regressor is not None:
            found = regress_keypoints(regressor, vertices[ours])
            measured += _keypoints(keypoint_errors(found, keypoints, clip.camera), frames.tolist())
        elif pairs:
            carried, goal = carried_keypoints(keypoints, frames, pairs, *maps)
            errors = keypoint_errors(carried, goal, clip.camera)
            measured += _keypoints(errors, [end for _, end in pairs])
    return measured


def _keypoints(errors: KeypointErrors, frames: Sequence[int]) -> list[Measured]:
    return [
        (metric, int(frame), float(value))
        for metric, values in errors._asdict().items()
        for frame, value in zip(frames, values, strict=True)
    ]


def _spread(points: Points, count: int) -> Points:
    """At most ``count`` of the points (..., N, 3), evenly spread over their order."""
    total = points.shape[-2]
    chosen = np.unique(np.linspace(0, total - 1, min(count, total)).round().astype(int))
    return points[..., chosen, :]


def _protocol(configuration: TruthConfig) -> str:
    return (
        f"distances in mm over {configuration.points} surface points at {configuration.frames} "
        "frames of the clip at most, each reached from "
        f"{configuration.pairs_per_frame} others; keypoints by the mesh's regressor, or carried "
        "between frames where it has none"
    )


def _tensor(points: Points) -> torch.Tensor:
    return torch.from_numpy(np.asarray(points, np.float32))


def _array(points: torch.Tensor) -> Points:
    return points.detach().numpy().astype(np.float64)
