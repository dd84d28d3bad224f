"""An animated mesh as one glTF 2.0 file (.glb).

Every pose is a morph target, and one animation fades from pose to pose. At rest, before it plays,
the file shows the base mesh. Source: Khronos, glTF 2.0 specification; KHR_materials_unlit.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.whole_file import whole_file

_FLOAT, _UNSIGNED = 5126, 5125
_VERTEX_DATA, _INDEX_DATA = 34962, 34963
_LARGEST_BYTES = 2**32 - 1  # lengths are 32-bit numbers
_ALIGNED = 4


@dataclass(frozen=True, eq=False)
class AnimatedMesh:
    """A mesh that takes T poses one after the other."""

    name: str
    vertices: NDArray[np.floating]  # (V, 3) metres
    faces: NDArray[np.int32]  # (F, 3), counter-clockwise from outside
    colours: NDArray[np.float32]  # (V, 3) sRGB-encoded in [0, 1]
    poses: NDArray[np.float32]  # (T, V, 3) metres
    pose_names: tuple[str, ...]
    times_s: NDArray[np.float64]  # (T,) ascending, seconds


def write_glb(path: Path, mesh: AnimatedMesh, up: ArrayLike) -> None:
    """Write the file; it appears complete or not at all.

    Coordinates stay as they are, and the mesh's node turns ``up`` (3,) to the format's +y. Colours
    are shown as they are, not shaded: they hold the light already.

    Raises:
        InputError: the file would be larger than the format allows, 4 GiB.
    """
    parts = _Parts()
    description = _description(mesh, np.asarray(up, np.float64), parts)
    document = json.dumps(description, separators=(",", ":")).encode()
    document += b" " * (-len(document) % _ALIGNED)
    total = 12 + 8 + len(document) + 8 + parts.size
    if total > _LARGEST_BYTES:
        raise InputError(
            "A .glb holds at most 4 GiB",
            f"{total / 2**30:.1f} GiB",
            "Give fewer --frames or a larger --spacing-m.",
        )
    with whole_file(path) as beside, beside.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, total))
        file.write(struct.pack("<I4s", len(document), b"JSON") + document)
        file.write(struct.pack("<I4s", parts.size, b"BIN\0"))
        for array in parts.arrays:
            file.write(array.tobytes())


@dataclass
class _Parts:
    """The arrays of the binary chunk, and how the document describes them."""

    arrays: list[NDArray] = field(default_factory=list)
    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    size: int = 0

    def add(self, array: NDArray, kind: str, target: int | None, bounded: bool = False) -> int:
        """Number of a new accessor for (N,) or (N, 3) values of 4 bytes each."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": array.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        component = _FLOAT if array.dtype == np.float32 else _UNSIGNED
        accessor: dict[str, Any] = {"bufferView": len(self.views) - 1, "componentType": component}
        accessor |= {"count": len(array), "type": kind}
        if bounded:
            columns = array.reshape(len(array), -1)
            accessor |= {"min": columns.min(0).tolist(), "max": columns.max(0).tolist()}
        self.arrays.append(array)
        self.accessors.append(accessor)
        self.size += array.nbytes
        return len(self.accessors) - 1

    def positions(self, points: NDArray) -> int:
        return self.add(points.astype(np.float32), "VEC3", _VERTEX_DATA, bounded=True)


def _description(mesh: AnimatedMesh, up: NDArray[np.float64], parts: _Parts) -> dict[str, Any]:
    """The document; its arrays go into the parts."""
    attributes = {
        "POSITION": parts.positions(mesh.vertices),
        "COLOR_0": parts.add(_linear(mesh.colours), "VEC3", _VERTEX_DATA),
    }
    primitive = {
        "attributes": attributes,
        "indices": parts.add(mesh.faces.astype(np.uint32).ravel(), "SCALAR", _INDEX_DATA),
        "material": 0,
        "targets": [{"POSITION": parts.positions(pose - mesh.vertices)} for pose in mesh.poses],
    }
    shape = {
        "name": mesh.name,
        "primitives": [primitive],
        "weights": [0.0] * len(mesh.poses),
        "extras": {"targetNames": list(mesh.pose_names)},
    }
    return {
        "asset": {"version": "2.0", "generator": "mocoflow"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": mesh.name, "mesh": 0, "rotation": _to_y(up)}],
        "meshes": [shape],
        "materials": [
            {
                "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
                "extensions": {"KHR_materials_unlit": {}},
            }
        ],
        "animations": [_animation(mesh, parts)],
        "accessors": parts.accessors,
        "bufferViews": parts.views,
        "buffers": [{"byteLength": parts.size}],
    }


def _animation(mesh: AnimatedMesh, parts: _Parts) -> dict[str, Any]:
    """At each pose's time its own weight is one and all others are zero; linear in between."""
    times = parts.add(mesh.times_s.astype(np.float32), "SCALAR", None, bounded=True)
    weights = parts.add(np.eye(len(mesh.poses), dtype=np.float32).ravel(), "SCALAR", None)
    return {
        "name": "clip",
        "samplers": [{"input": times, "output": weights, "interpolation": "LINEAR"}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
    }


def _linear(encoded: NDArray[np.float32]) -> NDArray[np.float32]:
    """Linear light of sRGB values, which is what the format has at vertices."""
    dark = encoded / 12.92
    bright = ((encoded.clip(0.0, 1.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, dark, bright).clip(0.0, 1.0).astype(np.float32)


def _to_y(up: NDArray[np.float64]) -> list[float]:
    """The shortest turn from a unit vector to +y as a quaternion x, y, z, w."""
    quaternion = np.append(np.cross(up, [0.0, 1.0, 0.0]), 1.0 + up[1])
    length = np.linalg.norm(quaternion)
    # From -y there are many: half a turn about x.
    return (quaternion / length).tolist() if length > 1e-6 else [1.0, 0.0, 0.0, 0.0]
