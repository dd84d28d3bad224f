"""Distance of a reconstructed surface from the true mesh."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.correspondence import MM_PER_M, Points


def surface_distance(
    points: Points, vertices: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Distance (N,) of each point (N, 3) to the nearest point of a mesh, metres.

    Exact: to the triangles, with their edges and corners, not to samples of them.
    """
    mesh = trimesh.Trimesh(np.asarray(vertices, np.float64), faces, process=False)
    _, distance, _ = trimesh.proximity.closest_point(mesh, points)
    return np.asarray(distance, np.float64)


def surface_mm(points: Points, vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> float:
    """Mean distance in mm of a reconstruction's surface points (N, 3) from the true mesh.

    The points are where the opacity along a ray passes 0.5, or what ``rasterise`` sees of a mesh
    estimate (``surface_points``), so that both are judged by what a camera sees of them.

    Raises:
        InputError: no points, because then nothing was reconstructed.
    """
    if len(points) == 0:
        raise InputError("points on the surface", "none", "Leave this view out and count it.")
    return MM_PER_M * float(surface_distance(points, vertices, faces).mean())
