"""Bodies of AIST++: the male SMPL model without shape, in each sequence's own scale."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.datasets.body_model_file import find_body_model
from mocoflow_core.datasets.dataset_scene import DatasetMeshes
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_untrusted

JOINTS = 24


@dataclass(frozen=True, eq=False)
class Motion:
    """A sequence's pose at each tick, in the data set's units (about centimetres)."""

    poses: NDArray[np.float64]  # (N, 24, 3) axis-angle, joint 0 global
    translations: NDArray[np.float64]  # (N, 3)
    scaling: float  # model metres -> world units


def read_motion_file(file: Path) -> Motion | None:
    """``motions/<seq>.pkl``; poses (N, 72) and (N, 24, 3), scalings () to (1, 1) alike.

    None where there is no file. Raises InputError for another content.
    """
    if not file.is_file():
        return None
    content = read_untrusted(file)
    try:
        poses = np.asarray(content["smpl_poses"], np.float64)
        translations = np.asarray(content["smpl_trans"], np.float64).reshape(-1, 3)
        scaling = float(np.asarray(content["smpl_scaling"], np.float64).reshape(()))
        poses = poses.reshape(len(translations), JOINTS, 3)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"smpl_poses (N, 72), smpl_trans (N, 3) and smpl_scaling in {file.name}",
            str(error),
            "Unpack the AIST++ motions again.",
        ) from error
    if not (np.isfinite(poses).all() and np.isfinite(translations).all() and scaling > 0):
        raise InputError(f"finite numbers in {file.name}", "others", "Unpack it again.")
    return Motion(poses, translations, scaling)


def posed_motion(
    motion: Motion, clip: NDArray[np.int32], unit_m: float, body_model: Path | None
) -> tuple[DatasetMeshes, tuple[str, ...]]:
    """The bodies of the clip's ticks in world metres, and remarks.

    The scaling multiplies the posed body about the model's origin, then it is moved.

    Raises InputError without the male SMPL model.
    """
    purpose = "pose the motions of AIST++ (not needed with bodies=none and an estimate by --meshes)"
    file, doubt = find_body_model(body_model, "male", purpose)
    model = read_smpl_model(file)
    shape = np.zeros(model.shape_directions.shape[-1])
    bodies = posed_vertices(model, motion.poses[clip], shape)
    world = motion.scaling * bodies + motion.translations[clip, None]
    sequence = MeshSequence(
        clip, (unit_m * world).astype(np.float32), np.asarray(model.faces, np.int32)
    )
    meshes = DatasetMeshes(sequence, "world", True, "AIST++ motion (multi-view fit)")
    remarks = ("bodies are the male SMPL model without shape, for every dancer",)
    return meshes, remarks + ((doubt,) if doubt else ())
