"""Bodies of AIST++: the male SMPL model without shape, in each sequence's own scale."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.datasets.body_model_file import find_body_model
from mocoflow_core.datasets.dataset_scene import DatasetMeshes
from mocoflow_core.estimators.aist_motion import METRES, Motion, motion_vertices


def posed_motion(
    motion: Motion, clip: NDArray[np.int32], unit_m: float, body_model: Path | None
) -> tuple[DatasetMeshes, tuple[str, ...]]:
    """The bodies of the clip's ticks in world metres, and remarks.

    Args:
        unit_m: metres of one unit of the data set's world, about a centimetre.

    Raises InputError without the male SMPL model.
    """
    purpose = "pose the motions of AIST++ (not needed with bodies=none and an estimate by --meshes)"
    file, doubt = find_body_model(body_model, "male", purpose)
    model = read_smpl_model(file)
    vertices = np.float32(unit_m / METRES) * motion_vertices(motion, model, clip)
    sequence = MeshSequence(clip, vertices, np.asarray(model.faces, np.int32))
    meshes = DatasetMeshes(sequence, "world", True, "AIST++ motion (multi-view fit)")
    remarks = ("bodies are the male SMPL model without shape, for every dancer",)
    return meshes, remarks + ((doubt,) if doubt else ())
