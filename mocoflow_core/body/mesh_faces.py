"""The triangles of a body whose source stores vertices only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_file import MESH_SUFFIXES, read_mesh
from mocoflow_core.body.smpl_file import missing_model, read_smpl_model
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_npz


def read_faces(path: Path, vertex_count: int) -> NDArray[np.int32]:
    """Faces (F, 3) for bodies of ``vertex_count`` vertices.

    Args:
        path: a mesh with the same vertices in the same order, such as People-Snapshot's
            ``consensus.obj``; our own ``meshes.npz``; or a body model file.
        vertex_count: V of the bodies that the faces are for.

    Raises:
        InputError: no such file, no mesh and no model, or one of other vertices.
    """
    if not path.is_file():
        raise missing_model(f"none at {path}, nor a mesh to take the faces from")
    count, faces = _counted_faces(path)
    if count != vertex_count or not len(faces) or faces.min() < 0 or faces.max() >= count:
        raise InputError(
            f"{path} must be a mesh of {vertex_count} vertices",
            f"{count} vertices and {len(faces)} faces",
            "Give a mesh or a model of the same kind as the bodies.",
        )
    return faces


def _counted_faces(path: Path) -> tuple[int, NDArray[np.int32]]:
    """How many vertices there are, and the faces."""
    if path.suffix.lower() in MESH_SUFFIXES:
        vertices, faces = read_mesh(path)
        return len(vertices), faces
    if path.suffix.lower() == ".npz":
        arrays = read_npz(path)
        bodies, own = arrays.get("vertices"), arrays.get("faces")
        if isinstance(bodies, np.ndarray) and isinstance(own, np.ndarray):
            if bodies.ndim == 3 and own.ndim == 2 and own.dtype.kind in "iu":
                return bodies.shape[1], own.astype(np.int32)
    model = read_smpl_model(path)
    return model.vertex_count, model.faces
