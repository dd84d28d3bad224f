"""The triangles of a body whose source stores vertices only."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from mocoflow_core.body.smpl_file import missing_model, read_smpl_model
from mocoflow_core.errors import InputError

MESH_ENDINGS = (".obj", ".ply", ".off", ".stl", ".glb")


def read_faces(path: Path, vertex_count: int) -> NDArray[np.int32]:
    """Faces (F, 3) for bodies of ``vertex_count`` vertices.

    Args:
        path: a mesh with the same vertices in the same order, such as People-Snapshot's
            ``consensus.obj``, or a body model file.
        vertex_count: V of the bodies that the faces are for.

    Raises:
        InputError: no such file, no mesh and no model, or one of other vertices.
    """
    if not path.is_file():
        raise missing_model(f"none at {path}, nor a mesh to take the faces from")
    if path.suffix.lower() == ".obj":
        count, faces = _obj_faces(path)
    elif path.suffix.lower() in MESH_ENDINGS:
        count, faces = _mesh_faces(path)
    else:
        model = read_smpl_model(path)
        count, faces = model.vertex_count, model.faces
    if count != vertex_count or not len(faces) or faces.min() < 0 or faces.max() >= count:
        raise InputError(
            f"{path} must be a mesh of {vertex_count} vertices",
            f"{count} vertices and {len(faces)} faces",
            "Give a mesh or a model of the same kind as the bodies.",
        )
    return faces


def _obj_faces(path: Path) -> tuple[int, NDArray[np.int32]]:
    """Vertex count and faces as written: loaders split or join vertices along texture seams."""
    count, faces = 0, []
    with path.open("rb") as file:
        for line in file:
            words = line.split()
            if words[:1] == [b"v"]:
                count += 1
            elif words[:1] == [b"f"]:
                corners = [_corner(word, count, path) for word in words[1:]]
                faces += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
    return count, np.array(faces, np.int32).reshape(-1, 3)


def _corner(word: bytes, count: int, path: Path) -> int:
    try:
        number = int(word.split(b"/")[0])
    except ValueError as error:
        raise InputError(
            f"{path} must have faces of vertex numbers", f"{word[:20]!r}", "Export it again."
        ) from error
    # Numbers from one on; negative ones count back from the last vertex so far.
    return min(number - 1 if number > 0 else count + number, np.iinfo(np.int32).max)


def _mesh_faces(path: Path) -> tuple[int, NDArray[np.int32]]:
    try:
        with path.open("rb") as file:
            # From an open file, so that nothing beside it is read either.
            mesh = trimesh.load_mesh(file, file_type=path.suffix[1:].lower(), process=False)
        return len(mesh.vertices), np.asarray(mesh.faces, np.int32)
    except Exception as error:
        raise InputError(
            f"{path} must be a readable mesh",
            f"{type(error).__name__}: {str(error)[:100]}",
            "Export it again, for instance as OBJ.",
        ) from error
