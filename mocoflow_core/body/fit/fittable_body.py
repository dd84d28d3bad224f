"""The body that is fitted: Anny reduced to the joints, shapes and vertices that a fit needs.

The arrays are made by ``mocoflow_core.synthetic.body_family`` from the Anny package, whose assets
are CC0, and lie beside this file: nothing of Anny is loaded at run time.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file

Array = NDArray[np.float64]

_FILE = Path(__file__).with_name("anny_body.safetensors")

# Anny's bones that turn here; every other bone follows the nearest of these above it.
JOINTS: tuple[str, ...] = (
    *("root", "spine04", "spine02", "neck01", "head"),
    *(f"{bone}.{side}" for side in "LR" for bone in ("clavicle", "upperarm01", "lowerarm01")),
    *(f"{bone}.{side}" for side in "LR" for bone in ("upperleg01", "lowerleg01", "foot")),
)

# COCO's 17 keypoints in their order, then the feet.
LANDMARKS: tuple[str, ...] = (
    *("nose", "left_eye", "right_eye", "left_ear", "right_ear"),
    *("left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    *("left_wrist", "right_wrist", "left_hip", "right_hip"),
    *("left_knee", "right_knee", "left_ankle", "right_ankle"),
    *("left_heel", "right_heel", "left_toes", "right_toes"),
)

# What a shape means: linear in its coefficients.
READINGS: tuple[str, ...] = (
    *("stature_m", "gender", "age", "muscle", "weight", "height", "proportions"),
)


@dataclass(frozen=True, eq=False)
class FittableBody:
    """Rest pose: +z up, faces -y, left at +x, root joint at the origin, metres.

    Shape coefficients are independent and of usual size one over adults.
    """

    vertices: Array  # (V, 3) of the mean shape
    vertex_basis: Array  # (C, V, 3)
    heads: Array  # (J, 3) where each of ``JOINTS`` turns, mean shape
    head_basis: Array  # (C, J, 3)
    weights: Array  # (V, J) rows sum to one
    parents: NDArray[np.int64]  # (J,) parents come first; the root is its own
    faces: NDArray[np.int32]  # (F, 3)
    regressor: Array  # (21, V) ``LANDMARKS`` from vertices, rows sum to one
    readings: Array  # (len(READINGS), C + 1) linear, the last column constant

    @classmethod
    def load(cls, path: Path = _FILE) -> Self:
        """Read what ``save`` wrote, by default the body that comes with this package."""
        arrays = load_file(path)
        exact = {"parents": np.int64, "faces": np.int32}
        return cls(**{name: a.astype(exact.get(name, np.float64)) for name, a in arrays.items()})

    def save(self, path: Path) -> None:
        """Write one safetensors file, numbers in float32."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        save_file(
            {
                name: np.ascontiguousarray(a, np.int32 if a.dtype.kind == "i" else np.float32)
                for name, a in arrays.items()
            },
            path,
        )

    @property
    def shape_count(self) -> int:
        return len(self.vertex_basis)

    @cached_property
    def below(self) -> Array:
        """(J, J) one where the column's joint is the row's own or moves it."""
        moved = np.eye(len(self.parents))
        for joint in range(1, len(self.parents)):
            moved[joint] += moved[self.parents[joint]]
        return moved

    def rest_vertices(self, shape: Array) -> Array:
        """(V, 3) in the rest pose for coefficients (C,)."""
        return self.vertices + np.tensordot(shape, self.vertex_basis, 1)

    def rest_heads(self, shape: Array) -> Array:
        """(J, 3) joints in the rest pose."""
        return self.heads + np.tensordot(shape, self.head_basis, 1)

    def reading(self, name: str, shape: Array) -> float:
        """One of ``READINGS`` of a shape."""
        row = self.readings[READINGS.index(name)]
        return float(row[:-1] @ shape + row[-1])
