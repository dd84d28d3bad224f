"""A textured triangle surface: constant topology, its normals, its colour at any point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from mocoflow_core.synthetic.texture import Array

Albedo = Callable[[Array, NDArray[np.int8]], Array]


@dataclass(frozen=True, eq=False)
class Surface:
    """Faces with a part label each, and a colour that is a function of rest position and part."""

    rest_vertices: Array  # (V, 3) metres, the coordinates of the texture
    faces: NDArray[np.int32]  # (F, 3)
    face_parts: NDArray[np.int8]  # (F,)
    albedo: Albedo  # rest points (N, 3), parts (N,) -> linear reflectance (N, 3)

    @cached_property
    def _faces_to_vertices(self) -> csr_array:
        """(V, F) sums over the faces around each vertex."""
        face = np.repeat(np.arange(len(self.faces)), 3)
        ones = np.ones(3 * len(self.faces))
        return csr_array(
            (ones, (self.faces.ravel(), face)), shape=(len(self.rest_vertices), len(self.faces))
        )

    def normals(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unit outward normals (V, 3) of posed vertices (V, 3), weighted by area."""
        a, b, c = (vertices[self.faces[:, k]] for k in range(3))
        summed = self._faces_to_vertices @ np.cross(b - a, c - a)
        length = np.linalg.norm(summed, axis=1, keepdims=True)
        return summed / np.maximum(length, 1e-12)  # A vertex without faces keeps a zero normal.
