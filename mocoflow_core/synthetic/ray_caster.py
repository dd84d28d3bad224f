"""First hits of rays on a triangle mesh, through embree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Hits:
    """The rays that hit, and where."""

    rays: NDArray[np.int64]  # (N,) index of the ray
    faces: NDArray[np.int32]  # (N,) index of the triangle
    barycentric: Array  # (N, 3) weights of the triangle's corners

    def interpolate(self, values: Array, faces: NDArray[np.int32]) -> Array:
        """Per-vertex values (V, C) at the hits, (N, C)."""
        corners = faces[self.faces]
        return sum(
            (self.barycentric[:, k, None] * values[corners[:, k]] for k in range(3)),
            start=np.zeros((len(corners), values.shape[1]), np.float32),
        )


class RayCaster:
    """One mesh, ready for rays. Coordinates are metres, directions need no unit length."""

    def __init__(self, vertices: Array, faces: NDArray[np.int32]) -> None:
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(
            self._scene, np.ascontiguousarray(vertices, np.float32), faces.astype(np.int32)
        )

    def hit(self, origins: Array, directions: Array) -> Hits:
        """First hit of each ray (N, 3), in front of its origin."""
        result = self._scene.run(_rays(origins), _rays(directions), query="INTERSECT", output=True)
        rays = np.flatnonzero(result["primID"] >= 0)
        u, v = result["u"][rays], result["v"][rays]
        return Hits(rays, result["primID"][rays], np.stack([1 - u - v, u, v], axis=-1))

    def occluded(self, origins: Array, directions: Array) -> NDArray[np.bool_]:
        """Whether each ray (N, 3) hits anything."""
        return self._scene.run(_rays(origins), _rays(directions), query="OCCLUDED") >= 0


def _rays(vectors: Array) -> Array:
    return np.ascontiguousarray(vectors, np.float32)
