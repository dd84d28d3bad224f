"""Normals at the vertices of a posed mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def vertex_normals(vertices: NDArray[np.floating], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Normals (V, 3), of faces weighted by area, outward whichever way they wind.

    Not of unit length; zero where a vertex has no face, or only faces of no area.

    Args:
        vertices: (V, 3), any unit.
        faces: (F, 3).
    """
    points = np.asarray(vertices, np.float64)
    corners = points[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.stack(
        [
            np.bincount(faces.ravel(), np.repeat(flat[:, axis], 3), minlength=len(points))
            for axis in range(3)
        ],
        axis=-1,
    )
    # Six times the enclosed volume: positive where the faces wind outward.
    volume = (flat * (corners[:, 0] - points.mean(axis=0))).sum()
    return np.copysign(1.0, volume) * normals
