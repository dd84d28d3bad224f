"""Signed distance of a body mesh on a regular lattice: negative inside."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

Array = NDArray[np.float32]

# Lattice spacings from the surface within which the distance is exact.
_EXACT_WITHIN = 5.0


def signed_distance_lattice(
    vertices: Array, faces: NDArray[np.int32], spacing: float, margin: float
) -> tuple[Array, Array]:
    """Signed distance to a mesh at the points of a lattice around it.

    Args:
        vertices: (V, 3) metres; the mesh may intersect itself and have holes.
        faces: (F, 3).
        spacing: lattice spacing, metres.
        margin: how far the lattice reaches beyond the mesh, metres.

    Returns:
        ``origin`` (3,) of lattice point (0, 0, 0) and the distances (X, Y, Z), metres.
    """
    lower = vertices.min(0) - margin
    shape = np.ceil((np.ptp(vertices, axis=0) + 2 * margin) / spacing).astype(int) + 1
    axes = [lower[a] + spacing * np.arange(shape[a]) for a in range(3)]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    distance = _distance(lattice, _dense_samples(vertices, faces, 0.5 * spacing), spacing)
    inside = _inside(vertices, faces, axes)
    signed = np.where(inside, -1.0, 1.0) * distance
    return lower.astype(np.float32), signed.astype(np.float32)


def _distance(lattice: NDArray, samples: Array, spacing: float) -> NDArray:
    """Distance to the nearest sample: exact near the surface, a distance transform far from it.

    Exact queries far from the surface cost hundreds of times more and nobody needs them.
    """
    occupied = np.ones(lattice.shape[:3], bool)
    nearest = np.round((samples - lattice[0, 0, 0]) / spacing).astype(int)
    occupied[tuple(nearest.T)] = False
    distance = spacing * distance_transform_edt(occupied)
    close = distance < _EXACT_WITHIN * spacing
    distance[close], _ = cKDTree(samples).query(lattice[close])
    return distance


def _dense_samples(vertices: Array, faces: NDArray[np.int32], edge: float) -> Array:
    """Points on the surface no farther apart than about ``edge``."""
    dense, _ = trimesh.remesh.subdivide_to_size(vertices, faces, max_edge=edge, max_iter=12)
    return np.asarray(dense, np.float32)


def _inside(vertices: Array, faces: NDArray[np.int32], axes: list[NDArray]) -> NDArray[np.bool_]:
    """Inside by majority over the three axes of the winding number along lattice lines.

    Counting crossings with their sign keeps overlapping limbs inside, where parity would make
    them hollow; the majority outvotes a line that slips through a hole.
    """
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    votes = sum(_winding(mesh, axes, axis) > 0 for axis in range(3))
    return np.asarray(votes) >= 2


def _winding(mesh: trimesh.Trimesh, axes: list[NDArray], axis: int) -> NDArray[np.int32]:
    """Winding number at each lattice point, from signed crossings of rays along one axis."""
    others = [a for a in range(3) if a != axis]
    first, second = np.meshgrid(axes[others[0]], axes[others[1]], indexing="ij")
    origins = np.empty((first.size, 3))
    origins[:, others[0]], origins[:, others[1]] = first.ravel(), second.ravel()
    origins[:, axis] = axes[axis][0] - 1.0
    direction = np.zeros(3)
    direction[axis] = 1.0
    hits, lines, triangles = mesh.ray.intersects_location(
        origins, np.broadcast_to(direction, origins.shape), multiple_hits=True
    )
    shape = (first.shape[0], first.shape[1], len(axes[axis]))
    crossings = np.zeros(shape, np.int32)
    if len(lines):
        enters = -np.sign(mesh.face_normals[triangles][:, axis]).astype(np.int32)
        position = np.searchsorted(axes[axis], hits[:, axis])
        within = position < shape[2]
        i, j = np.unravel_index(lines[within], first.shape)
        np.add.at(crossings, (i, j, position[within]), enters[within])
    return np.moveaxis(np.cumsum(crossings, axis=2), 2, axis)
