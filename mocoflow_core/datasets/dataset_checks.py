"""What every imported data set must satisfy, and what a user should know of it: measured."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mocoflow_core.body.body_checks import (
    LEAST_OVERLAP,
    SHIFT_GAIN,
    SHIFTS,
    check_distance,
    check_height,
    check_path,
)
from mocoflow_core.body.mesh_checks import (
    require_finite,
    require_in_front,
    require_metres,
    require_shapes,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.calibration import require_calibration
from mocoflow_core.capture.checks import check_lens, check_share
from mocoflow_core.capture.frame_selection import require_contiguous
from mocoflow_core.capture.scene import UP_VECTORS
from mocoflow_core.datasets.dataset_scene import DatasetCamera, DatasetMeshes, DatasetScene
from mocoflow_core.datasets.picture_size import require_size
from mocoflow_core.datasets.sampled_masks import SampledMasks, sample_masks
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

# A body of the right person at the right place, in whatever pose, covers more of the mask.
HOPELESS_OVERLAP = 0.1


@dataclass(frozen=True)
class DatasetFindings:
    """Measured values by name, and what is unusual among them.

    What evaluation cameras show stands apart: choices must not be made by it.
    """

    measured: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()  # of the scene and the train camera
    elsewhere: tuple[str, ...] = ()  # of the evaluation cameras

    def __add__(self, other: DatasetFindings) -> DatasetFindings:
        return DatasetFindings(
            {**self.measured, **other.measured},
            self.warnings + other.warnings,
            self.elsewhere + other.elsewhere,
        )

    def of(self, camera: str, train_camera: str) -> DatasetFindings:
        """The same, its warnings those of a camera."""
        if camera == train_camera:
            return self
        return DatasetFindings(self.measured, elsewhere=self.warnings + self.elsewhere)


def check_dataset(scene: DatasetScene) -> DatasetFindings:
    """Look at calibration, sizes, counts, masks, and the body against them.

    Decodes the first frame of each camera and a few masks.

    Raises InputError for what cannot be right: K or R that are none, decoded sizes that disagree,
    missing train frames, masks that are all empty, a body in another unit, behind a camera, or
    nowhere near the masks though its location is given.
    """
    train = scene.cameras[scene.train_camera]
    if not len(train.frames.indices):
        raise InputError(f"frames of {scene.train_camera}", "none", "Check the chosen clip.")
    require_contiguous(train.frames.indices, f"frames of {scene.train_camera}")
    findings = _check_counts(scene, train)
    for name, camera in scene.cameras.items():
        findings += _check_camera(camera).of(name, scene.train_camera)
    sampled = {
        name: sample_masks(camera.camera, camera.masks, camera.frames.indices)
        for name, camera in scene.cameras.items()
        if camera.masks is not None
    }
    for name, masks in sampled.items():
        found = _check_foreground(name, masks, required=name == scene.train_camera)
        findings += found.of(name, scene.train_camera)
    return findings + _check_body(scene, sampled) if scene.meshes else findings


def _check_counts(scene: DatasetScene, train: DatasetCamera) -> DatasetFindings:
    measured = {"frames": float(len(train.frames.indices))}
    warnings = []
    if train.masks is not None:
        measured["masks"] = float(len(train.masks.indices))
        unmasked = np.setdiff1d(train.frames.indices, train.masks.indices)
        if len(unmasked):
            warnings.append(
                f"{len(unmasked)} frames of {scene.train_camera} have no mask, the first "
                f"{unmasked[0]}"
            )
    if scene.meshes:
        posed = scene.meshes.sequence.frame_indices
        measured["meshes"] = float(len(posed))
        bare = np.setdiff1d(train.frames.indices, posed)
        if len(bare):
            warnings.append(f"{len(bare)} frames have no body mesh, the first {bare[0]}")
    return DatasetFindings(measured, tuple(warnings))


def _check_camera(recorded: DatasetCamera) -> DatasetFindings:
    """Calibration and decoded sizes; a rotated or resized video shows here."""
    camera, first = recorded.camera, recorded.frames.indices[:1].tolist()
    require_calibration(camera, "the data set's calibration")
    for number, image in recorded.frames.read(first):
        require_size(image.shape[1::-1], camera.size, f"frame {number} of {camera.name}")
    return DatasetFindings(warnings=check_lens(camera))


def _check_foreground(name: str, sampled: SampledMasks, required: bool) -> DatasetFindings:
    shares = [float(mask.mean()) for mask in sampled.masks]
    share = float(np.median(shares)) if shares else 0.0
    if required and not any(shares):
        raise InputError(
            f"masks of {name} must show the person", "empty ones", "Check the mask files."
        )
    warnings = tuple(f"{name}: {warning}" for warning in check_share(share))
    return DatasetFindings({f"foreground_share of {name}": share}, warnings)


def _check_body(scene: DatasetScene, sampled: dict[str, SampledMasks]) -> DatasetFindings:
    assert scene.meshes is not None
    sequence, train = scene.meshes.sequence, scene.cameras[scene.train_camera].camera
    require_shapes(sequence)
    require_finite(sequence)
    require_metres(sequence)
    up = UP_VECTORS[scene.up]
    along = up if scene.meshes.coordinates == "world" else train.R @ up
    height, warnings = check_height(sequence.vertices, along)
    findings = DatasetFindings({"height_m": height}, warnings)
    if not scene.meshes.located or scene.meshes.coordinates == "camera-root-centred":
        return findings
    world = meshes_in_world(scene.meshes, train)
    speed, path_warnings = check_path(world, scene.fps)
    findings += DatasetFindings({"fastest_m_s": speed}, path_warnings)
    for name, recorded in scene.cameras.items():
        require_in_front(world, recorded.camera)
        distance, far = check_distance(world, recorded.camera)
        found = DatasetFindings({f"distance_m of {name}": distance}, far)
        if name in sampled and len(sampled[name].numbers):
            required = name == scene.train_camera
            found += _check_overlap(name, sampled[name], world, required)
        findings += found.of(name, scene.train_camera)
    return findings


def meshes_in_world(meshes: DatasetMeshes, train_camera: Camera) -> MeshSequence:
    """The located meshes in world metres."""
    if meshes.coordinates == "world":
        return meshes.sequence
    vertices = train_camera.to_world(meshes.sequence.vertices.astype(np.float64))
    return replace(meshes.sequence, vertices=vertices.astype(np.float32))


def _check_overlap(
    name: str, sampled: SampledMasks, world: MeshSequence, required: bool
) -> DatasetFindings:
    """Silhouettes against masks, the meshes moved by -1, 0 and +1 frame."""
    means = {shift: sampled.overlap(world, shift) for shift in SHIFTS}
    if required and means[0] < HOPELESS_OVERLAP:
        raise InputError(
            f"the body's silhouettes must lie on the masks of {name}",
            f"a mean overlap (IoU) of {means[0]:.2f}",
            "Check that calibration, masks and body belong to the same recording.",
        )
    warnings = []
    if means[0] < LEAST_OVERLAP:
        warnings.append(
            f"{name}: silhouettes overlap the masks by {means[0]:.2f} "
            f"(usual: above {LEAST_OVERLAP}): wrong axes, unit, gender, person or frames?"
        )
    best = max(means, key=lambda shift: means[shift])
    if means[best] > means[0] + SHIFT_GAIN:
        warnings.append(
            f"{name}: silhouettes overlap better by {means[best] - means[0]:.3f} with the meshes "
            f"moved by {best:+d} frame"
        )
    measured = {f"overlap at {shift:+d} of {name}": mean for shift, mean in means.items()}
    return DatasetFindings(measured, tuple(warnings))
