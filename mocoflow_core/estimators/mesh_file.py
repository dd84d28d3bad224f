"""One mesh of a file: vertices as they are stored, nothing merged, split or fetched."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from mocoflow_core.errors import InputError

MESH_SUFFIXES = (".obj", ".ply", ".glb")


def read_mesh(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices (V, 3) in the file's unit and triangles (F, 3) of an OBJ, PLY or GLB file.

    Nothing that the file names (materials, textures, other buffers) is opened.

    Raises InputError for anything else, and for a file without faces.
    """
    kind = path.suffix.lower()
    if kind not in MESH_SUFFIXES or not path.is_file():
        raise InputError(
            f"a mesh file ({', '.join(MESH_SUFFIXES)})", f"{path.name}", "Check the path."
        )
    content = path.read_bytes()
    if kind == ".obj":
        content = _bare_obj(content)
    try:
        # Without a resolver there is nothing that could fetch what a file names.
        loaded = trimesh.load(
            io.BytesIO(content),
            file_type=kind[1:],
            resolver=None,
            process=False,
            maintain_order=True,
        )
        mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
        assert isinstance(mesh, trimesh.Trimesh)
        vertices = np.asarray(mesh.vertices, np.float64)
        faces = np.asarray(mesh.faces, np.int32)
    # trimesh raises whatever its parsers meet.
    except Exception as error:
        raise InputError(
            f"a mesh in {path.name}", "what cannot be read as one", "Export the mesh again."
        ) from error
    if not len(faces) or vertices.ndim != 2:
        raise InputError(f"a mesh with faces in {path.name}", "none", "Export the mesh again.")
    return vertices, faces


def _bare_obj(content: bytes) -> bytes:
    """Vertices and faces alone.

    Texture coordinates would split vertices along seams, and materials name other files.
    """
    kept = []
    for line in content.splitlines():
        words = line.split()
        if words[:1] == [b"v"]:
            kept.append(b" ".join(words[:4]))
        elif words[:1] == [b"f"]:
            kept.append(b" ".join(word.split(b"/")[0] for word in words))
    return b"\n".join(kept) + b"\n"
