"""From a scene and an estimate of any kind to one checked mesh for each frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.ingest import IngestedMeshes, ingest_sequence
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import Scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.read import read_estimate
from mocoflow_core.progress import Progress, untold


def ingest_meshes(
    scene: Scene,
    meshes_override: Path | None = None,
    chosen: EstimateConfig = EstimateConfig(),  # noqa: B008 - frozen.
    progress: Progress = untold,
) -> IngestedMeshes:
    """Read, check and join the body meshes to the train camera's frames.

    An override may say its own coordinates and whether it is located; what it does not say is
    taken from the scene. Frames missing inside are interpolated when the gap is short, with a
    warning.

    Raises InputError as ``read_estimate`` and ``ingest_sequence`` do.
    """
    path = meshes_override or scene.meshes()
    if path is None or not path.exists():
        raise InputError(
            "a body mesh for each frame",
            "none" if path is None else f"no file {path}",
            "Name a mesh file in scene.json, or give one with --meshes.",
        )
    camera = scene.cameras[scene.train_camera]
    context = EstimateContext(camera, chosen, scene.description.meshes, progress)
    estimate = _numbered(read_estimate(path, context), scene)
    return ingest_sequence(
        scene,
        MeshSequence(
            estimate.frame_indices, estimate.vertices, estimate.faces, estimate.keypoint_regressor
        ),
        estimate.coordinates,
        estimate.located,
        is_scenes_own=path == scene.meshes(),
        first_translations=estimate.first_translations,
        remarks=estimate.remarks,
    )


def _numbered(estimate: BodyEstimate, scene: Scene) -> BodyEstimate:
    """With source numbers; without what belongs to the source and not to the clip cut out of it.

    Positions count from the first frame that the tool was given: the source's.
    """
    clip = scene.frames(scene.train_camera).indices
    begins_at = scene.description.source_begins_at
    if estimate.numbering == "position":
        first = clip[0] if begins_at is None else begins_at
        numbers = (estimate.frame_indices + first).astype(np.int32)
        estimate = replace(estimate, frame_indices=numbers, numbering="source")
    return estimate if begins_at is None else _cut_to(estimate, clip)


def _cut_to(estimate: BodyEstimate, clip: NDArray[np.int32]) -> BodyEstimate:
    """The rows from the clip's first to its last frame. Raises InputError where there is none."""
    numbers = estimate.frame_indices
    inside = (numbers >= clip[0]) & (numbers <= clip[-1])
    if inside.all() or len(inside) != len(estimate.vertices):
        return estimate
    held = f"frames {numbers.min()} to {numbers.max()} of the source"
    if not inside.any():
        raise InputError(
            f"meshes of the clip's frames {clip[0]} to {clip[-1]}",
            held,
            "If the tool was given the clip alone, say how many frames of the source come before "
            "it with --set meshes.first_frame=N.",
        )
    first = estimate.first_translations
    return replace(
        estimate,
        frame_indices=numbers[inside],
        vertices=estimate.vertices[inside],
        first_translations=None if first is None else first[inside],
        remarks=(
            *estimate.remarks,
            f"the estimate holds {held}: those of the clip, {clip[0]} to {clip[-1]}, are used",
        ),
    )
