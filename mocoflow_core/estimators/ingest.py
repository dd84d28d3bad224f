"""From a scene and an estimate of any kind to one checked mesh for each frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocoflow_core.body.ingest import IngestedMeshes, ingest_sequence
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import Scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.known import Known
from mocoflow_core.estimators.read import read_estimate


def ingest_meshes(
    scene: Scene,
    meshes_override: Path | None = None,
    chosen: EstimateConfig = EstimateConfig(),  # noqa: B008 - frozen.
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
    known = Known(scene.cameras[scene.train_camera], chosen, scene.description.meshes)
    estimate = read_estimate(path, known)
    return ingest_sequence(
        scene,
        _sequence(estimate, scene),
        estimate.coordinates,
        estimate.located,
        is_scenes_own=path == scene.meshes(),
        first_translations=estimate.first_translations,
        remarks=estimate.remarks,
    )


def _sequence(estimate: BodyEstimate, scene: Scene) -> MeshSequence:
    """With source numbers: positions count from the first frame of the video."""
    numbers = estimate.frame_indices
    if estimate.numbering == "position":
        numbers = numbers + scene.frames(scene.train_camera).indices[0]
    return MeshSequence(
        numbers.astype(np.int32), estimate.vertices, estimate.faces, estimate.keypoint_regressor
    )
