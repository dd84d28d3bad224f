"""One mesh of a file: vertices as they are stored, nothing merged, split or fetched."""

from __future__ import annotations

import io
import json
from collections import Counter
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from mocoflow_core.errors import InputError

MESH_SUFFIXES = (".obj", ".ply", ".off", ".glb")

_GLB_HEADER = Struct("<4sIIII")  # magic, version, length, and of the first chunk length and type
_GLB_VERSION, _JSON_CHUNK = 2, 0x4E4F534A
# What a body's file may come to, over all that it repeats.
MOST_CORNERS = 5_000_000


def read_mesh(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices (V, 3) in the file's unit and triangles (F, 3) of an OBJ, PLY, OFF or GLB file.

    Nothing that the file names (materials, textures, other buffers) is opened.

    Raises InputError for anything else, and for a file without faces.
    """
    kind = path.suffix.lower()
    if kind not in MESH_SUFFIXES or not path.is_file():
        raise InputError(
            f"a mesh file ({', '.join(MESH_SUFFIXES)})", f"{path.name}", "Check the path."
        )
    content = path.read_bytes()
    try:
        if kind in _BARE:
            content = _BARE[kind](content)
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
    except InputError as error:
        raise InputError(f"{path.name} {error.required}", error.got, error.action) from error
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


def _bare_glb(content: bytes) -> bytes:
    """Places and faces alone, of a sensible number.

    Pictures need not be unpacked, and a few bytes can name the same mesh thousands of times.
    """
    magic, version, _, length, kind = _GLB_HEADER.unpack_from(content)
    start, end = _GLB_HEADER.size, _GLB_HEADER.size + length
    if (magic, version, kind) != (b"glTF", _GLB_VERSION, _JSON_CHUNK):
        raise ValueError("no GLB of version 2")
    scene = json.loads(content[start:end])
    bare = {name: scene[name] for name in _GLB_PARTS if name in scene}
    bare["meshes"] = [_bare_mesh(mesh) for mesh in scene["meshes"]]
    _require_modest(bare, len(content))
    text = json.dumps(bare).encode()
    text += b" " * (-len(text) % 4)
    whole = start + len(text) + len(content) - end
    return _GLB_HEADER.pack(magic, version, whole, len(text), kind) + text + content[end:]


_GLB_PARTS = ("asset", "scene", "scenes", "nodes", "accessors", "bufferViews", "buffers")
_BARE = {".obj": _bare_obj, ".glb": _bare_glb}


def _bare_mesh(mesh: dict[str, Any]) -> dict[str, Any]:
    primitives = [
        {"attributes": {"POSITION": part["attributes"]["POSITION"]}}
        | {name: part[name] for name in ("indices", "mode") if name in part}
        for part in mesh["primitives"]
    ]
    return {"primitives": primitives} | ({"name": mesh["name"]} if "name" in mesh else {})


def _require_modest(scene: dict[str, Any], size: int) -> None:
    """Raise InputError for arrays beyond the file's size, or a mesh that it repeats too often."""
    counts = [int(accessor["count"]) for accessor in scene["accessors"]]
    uses = Counter(node["mesh"] for node in scene.get("nodes", ()) if "mesh" in node)
    corners = sum(
        max(uses[number], 1)
        * (counts[part["attributes"]["POSITION"]] + counts[part.get("indices", 0)])
        for number, mesh in enumerate(scene["meshes"])
        for part in mesh["primitives"]
    )
    beyond = any(not 0 <= count <= size for count in counts)
    if beyond or max(corners, sum(counts)) > MOST_CORNERS:
        raise InputError(
            f"must be one body of at most {MOST_CORNERS:,} corners",
            f"{corners:,} in {size:,} bytes",
            "Export the mesh once, without copies.",
        )
