"""Finer triangles on the same flat surface, for any pose of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse


@dataclass(frozen=True, eq=False)
class Subdivision:
    """A finer mesh whose vertices are fixed mixtures of the coarse mesh's vertices."""

    weights: sparse.csr_matrix  # (fine V, coarse V), rows sum to one
    faces: NDArray[np.int32]  # (fine F, 3)
    levels: int

    def refine(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """Values (fine V, C) at the fine vertices from values (V, C) at the coarse ones."""
        return np.asarray(self.weights @ values, np.float64)

    def locate(
        self, face_index: NDArray[np.int32], barycentric: NDArray[np.floating]
    ) -> tuple[NDArray[np.int32], NDArray[np.floating]]:
        """Fine face (N,) and weights (N, 3) of points given on the coarse mesh.

        Casting rays at the coarse mesh and locating the hits costs a fraction of casting them at
        the fine one, and it is the same surface.
        """
        face, weights = face_index, barycentric
        count = len(self.faces) // 4**self.levels
        for _ in range(self.levels):
            corner = np.where(weights.max(axis=1) >= 0.5, weights.argmax(axis=1), 3)
            at_corner = 2.0 * weights - np.eye(4, 3, dtype=weights.dtype)[corner]
            # The middle child's corners are the midpoints of ab, bc and ca.
            in_middle = 1.0 - 2.0 * np.roll(weights, 1, axis=1)
            weights = np.where((corner == 3)[:, None], in_middle, at_corner)
            face = (corner * count + face).astype(np.int32)
            count *= 4
        return face, weights


def subdivide(faces: NDArray[np.int32], vertex_count: int, levels: int) -> Subdivision:
    """Split every triangle into four at its edges' midpoints, ``levels`` times."""
    weights = sparse.identity(vertex_count, format="csr")
    for _ in range(levels):
        midpoints, faces = _split(faces, weights.shape[0])
        weights = sparse.vstack([weights, midpoints @ weights], format="csr")
    return Subdivision(weights, faces, levels)


def levels_for(
    vertices: NDArray[np.floating], faces: NDArray[np.int32], spacing_m: float, max_vertices: int
) -> int:
    """Levels until the median edge is at most ``spacing_m``, or the count would be too large."""
    edges = vertices[faces] - vertices[np.roll(faces, 1, axis=1)]
    median = float(np.median(np.linalg.norm(edges, axis=-1)))
    wanted = int(np.ceil(np.log2(max(median / spacing_m, 1.0))))
    # Each level has four times the vertices.
    affordable = int(np.log(max(max_vertices / len(vertices), 1.0)) / np.log(4.0))
    return min(wanted, affordable)


def unique_edges(faces: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Undirected edges (E, 2) and, for each face, the rows (F, 3) of its 01, 12, 20 edges."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges, rows = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    return edges.astype(np.int64), rows.reshape(-1, 3)


def _split(
    faces: NDArray[np.int32], vertex_count: int
) -> tuple[sparse.csr_matrix, NDArray[np.int32]]:
    """Mixtures (E, V) that make the new midpoints, and the four times as many faces."""
    edges, rows = unique_edges(faces)
    owner = np.repeat(np.arange(len(edges)), 2)
    midpoints = sparse.csr_matrix(
        (np.full(2 * len(edges), 0.5), (owner, edges.ravel())), shape=(len(edges), vertex_count)
    )
    ab, bc, ca = (vertex_count + rows).T
    a, b, c = faces.T
    children = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return midpoints, np.concatenate([np.stack(child, axis=1) for child in children]).astype(
        np.int32
    )
