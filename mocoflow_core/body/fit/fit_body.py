"""A body fitted to what one camera saw of a person: landmarks first, then outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.body.fit.first_guess import first_guess
from mocoflow_core.body.fit.fittable_body import READINGS, FittableBody
from mocoflow_core.body.fit.landmark_misfit import LandmarkConfig, LandmarkMisfit, project
from mocoflow_core.body.fit.least_squares import Term, minimise
from mocoflow_core.body.fit.mask_misfit import MaskConfig, MaskOutlines
from mocoflow_core.body.fit.posed_body import BodyPose, PosedBody
from mocoflow_core.body.fit.prior import Fact, Prior, PriorConfig
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.progress import Progress

Array = NDArray[np.float64]
_MESH_ARRAYS = ("frame_indices", "vertices", "faces", "keypoint_regressor")
_UNKNOWNS = ("places", "rotations", "angles", "shape", "clothes")

_COCO = 17
# At first landmarks count as if they erred so many times as much.
_ROUGHLY = 4.0


class BodyFitConfig(ConfigurationPart):
    """What is known of the person, and how long to search."""

    height_m: float | None = Field(
        None, ge=1.3, le=2.3, description="The person's height, barefoot; moves the depth with it."
    )
    gender: float | None = Field(None, ge=0, le=1, description="0 male, 1 female; tells the size.")
    landmarks: LandmarkConfig = LandmarkConfig()
    masks: MaskConfig = MaskConfig()
    prior: PriorConfig = PriorConfig()
    rough_steps: int = Field(15, ge=1, description="First steps, which forgive large errors.")
    steps: int = Field(15, ge=0, description="Steps onto the landmarks.")
    looks: int = Field(5, ge=0, description="How often outlines are matched.")
    steps_a_look: int = Field(2, ge=1, description="Steps after each match.")


@dataclass(frozen=True, eq=False)
class FittedBody:
    """A located body for every frame, world metres, with how well it fits."""

    meshes: MeshSequence
    pose: BodyPose
    readings: dict[str, float]  # what the shape means: stature in metres and Anny's phenotype
    landmark_px: Array  # (T,) rms distance of the landmarks seen; NaN where none is
    silhouette_iou: Array  # (T,) NaN without a mask that may be looked at
    warnings: tuple[str, ...]

    @property
    def usual_overlap(self) -> float | None:
        """Median intersection over union with the masks; None where there is no mask."""
        known = self.silhouette_iou[np.isfinite(self.silhouette_iou)]
        return float(np.median(known)) if len(known) else None

    def save(self, folder: Path) -> None:
        """Write ``meshes.npz``, which is a scene's mesh file, and ``fit.npz`` with all unknowns."""
        meshes = {name: getattr(self.meshes, name) for name in _MESH_ARRAYS}
        np.savez(folder / "meshes.npz", **meshes, coordinates="world", located=True)
        unknowns = {name: getattr(self.pose, name) for name in _UNKNOWNS}
        np.savez(
            folder / "fit.npz",
            **unknowns,
            landmark_px=self.landmark_px,
            silhouette_iou=self.silhouette_iou,
        )


def fit_body(
    sightings: Sightings,
    masks: NDArray[np.bool_] | None,
    camera: Camera,
    fps: float,
    configuration: BodyFitConfig,
    frame_indices: NDArray[np.int32] | None = None,
    up_world: Array | None = None,
    usable: NDArray[np.bool_] | None = None,
    progress: Progress = lambda fraction, text: None,
) -> FittedBody:
    """The likeliest movement of one person, given landmarks and masks of an evenly timed clip.

    The root is turned by landmarks in space or chosen among headings; then joints, place and one
    shape for all frames are found by damped Gauss-Newton steps, on landmarks, then on outlines as
    well. Depth and size are one unknown: without a height the usual one decides.

    Args:
        sightings: of T frames, ``fps`` apart; frames without anybody are bridged.
        masks: (T, H, W), an empty one says nothing; None leaves the outlines out.
        camera: a pinhole of the landmarks' pixels.
        up_world: (3,) where it is known; people mostly stand upright.
        usable: (T,) frames that may be looked at, None all; the others are bridged like frames
            without anybody.

    Raises InputError for sizes that disagree.
    """
    _check(sightings, masks, camera)
    if usable is not None:
        sightings = sightings.of_frames(usable)
        masks = None if masks is None else masks & usable[:, None, None]
    body = FittableBody.load()
    prior = _prior(body, camera, fps, configuration, up_world, float(sightings.seen.mean()))
    up = -np.array([0.0, 1.0, 0.0]) if prior.up is None else prior.up
    shape = _usual_shape(body, prior.facts)
    progress(0.0, "guessing where the person faces")
    pose = first_guess(body, sightings, camera.K, up, shape)
    close = _landmark_misfit(body, sightings, camera, pose, configuration)
    far = replace(close, picture_error_m=_ROUGHLY * close.picture_error_m)
    progress(0.1, "fitting the landmarks")
    pose = minimise([prior, far], pose, configuration.rough_steps)
    pose = minimise([prior, close], pose, configuration.steps)
    overlaps = np.full(len(pose.places), np.nan)
    sized = configuration.height_m is not None
    if masks is not None and masks.any():
        outlines = MaskOutlines.of(body, masks, camera, configuration.masks)
        pose = _onto_masks(outlines, [prior, close], pose, configuration, progress)
        overlaps = outlines.overlaps(pose)
    missed = ~sightings.seen if usable is None else usable & ~sightings.seen
    warnings = _warnings(missed, overlaps, body.reading("stature_m", pose.shape), sized)
    return _fitted(body, pose, sightings, overlaps, camera, frame_indices, warnings)


def _onto_masks(
    outlines: MaskOutlines,
    terms: list[Term],
    pose: BodyPose,
    configuration: BodyFitConfig,
    progress: Progress,
) -> BodyPose:
    first, last = configuration.masks.outlier_m
    for look in range(configuration.looks):
        share = look / max(configuration.looks - 1, 1)
        progress(0.4 + 0.5 * look / configuration.looks, "fitting the outlines")
        misfit = outlines.look(pose, first ** (1 - share) * last**share)
        pose = minimise([*terms, misfit], pose, configuration.steps_a_look)
    return pose


def _prior(
    body: FittableBody,
    camera: Camera,
    fps: float,
    configuration: BodyFitConfig,
    up_world: Array | None,
    seen_share: float,
) -> Prior:
    facts = []
    if configuration.height_m is not None:
        facts.append(Fact("stature_m", configuration.height_m, 0.005))
    if configuration.gender is not None:
        facts.append(Fact("gender", configuration.gender, 0.1))
    up = None if up_world is None else camera.R @ up_world
    return Prior(body, 1.0 / fps, configuration.prior, tuple(facts), up, seen_share)


def _usual_shape(body: FittableBody, facts: Sequence[Fact]) -> Array:
    """The likeliest shape (C,) for what is known."""
    if not facts:
        return np.zeros(body.shape_count)
    rows = np.stack([body.readings[READINGS.index(f.reading)] for f in facts])
    spread = np.diag([f.spread**2 for f in facts])
    off = np.array([f.value for f in facts]) - rows[:, -1]
    rows = rows[:, :-1]
    return rows.T @ np.linalg.solve(rows @ rows.T + spread, off)


def _landmark_misfit(
    body: FittableBody,
    sightings: Sightings,
    camera: Camera,
    pose: BodyPose,
    configuration: BodyFitConfig,
) -> LandmarkMisfit:
    focal = np.sqrt(camera.K[0, 0] * camera.K[1, 1])
    return LandmarkMisfit(
        body,
        sightings.points(body),
        sightings,
        camera.K,
        pose.places[:, 2] / focal,
        configuration.landmarks,
        configuration.landmarks.picture_error_m,
    )


def _fitted(
    body: FittableBody,
    pose: BodyPose,
    sightings: Sightings,
    overlaps: Array,
    camera: Camera,
    frame_indices: NDArray[np.int32] | None,
    warnings: tuple[str, ...],
) -> FittedBody:
    posed = PosedBody.of(body, pose)
    world = camera.to_world(posed.vertices()).astype(np.float32)
    indices = np.arange(len(world), dtype=np.int32) if frame_indices is None else frame_indices
    regressor = body.regressor[:_COCO].astype(np.float32)
    landmark_px = _landmark_px(posed, sightings, camera)
    return FittedBody(
        MeshSequence(indices, world, body.faces, regressor),
        pose,
        {name: round(body.reading(name, pose.shape), 3) for name in READINGS},
        landmark_px,
        overlaps,
        warnings,
    )


def _landmark_px(posed: PosedBody, sightings: Sightings, camera: Camera) -> Array:
    places = posed.points(sightings.points(posed.body).shaped(posed.pose.shape))
    pixels, _ = project(places, camera.K)
    squared = ((pixels - sightings.places) ** 2).sum(-1)
    total = sightings.confidence.sum(1)
    mean = (sightings.confidence * squared).sum(1) / np.maximum(total, 1e-9)
    return np.where(total > 0, np.sqrt(mean), np.nan)


def _warnings(
    missed: NDArray[np.bool_], iou: Array, stature_m: float, sized: bool
) -> tuple[str, ...]:
    warnings = []
    if missed.any():
        warnings.append(f"{missed.sum()} of {len(missed)} frames show nobody and are bridged")
    if np.isfinite(iou).any() and np.nanmedian(iou) < 0.7:
        warnings.append(f"the fitted body overlaps the masks by {np.nanmedian(iou):.2f} only")
    if not sized:
        warnings.append(
            f"nobody said how tall the person is: {stature_m:.2f} m is assumed, and the distance "
            "with it"
        )
    return tuple(warnings)


def _check(sightings: Sightings, masks: NDArray[np.bool_] | None, camera: Camera) -> None:
    frames = len(sightings.places)
    if masks is not None and masks.shape != (frames, camera.height, camera.width):
        raise InputError(
            f"masks ({frames}, {camera.height}, {camera.width}) like landmarks and camera",
            str(masks.shape),
            "Give one mask of the camera's size for each frame.",
        )
    if not camera.is_pinhole:
        raise InputError(
            "a pinhole camera", "one with distortion", "Undistort pictures and landmarks first."
        )
