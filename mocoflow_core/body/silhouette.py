"""The outline of a body in an image: which pixels its mesh covers, and how well they agree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera

Mask = NDArray[np.bool_]
# A triangle nearer than this is not drawn: its projection is meaningless.
NEAR_M = 0.05


def silhouettes(
    vertices_world: NDArray[np.floating], faces: NDArray[np.int32], camera: Camera
) -> Mask:
    """Pixels (T, H, W) whose centres the projected mesh covers.

    ``vertices_world`` (T, V, 3) metres, ``faces`` (F, 3); the camera must be a pinhole.
    """
    return np.stack([silhouette(vertices, faces, camera) for vertices in vertices_world])


def silhouette(
    vertices_world: NDArray[np.floating], faces: NDArray[np.int32], camera: Camera
) -> Mask:
    """The same for one frame: (V, 3) to (H, W)."""
    points = camera.to_camera(np.asarray(vertices_world, np.float64))
    projected = points @ camera.K.T
    pixels = projected[:, :2] / np.maximum(projected[:, 2:], NEAR_M)
    visible = faces[(points[:, 2] > NEAR_M)[faces].all(axis=1)]
    return cover(pixels, visible, camera.width, camera.height)


def cover(pixels: NDArray[np.float64], faces: NDArray[np.int32], width: int, height: int) -> Mask:
    """Pixels (height, width) whose centres lie in a triangle of ``pixels`` (V, 2), corner origin.

    Every pixel of every triangle's box is tested against the three edges, all at once.
    """
    covered = np.zeros((height, width), bool)
    corners = pixels[faces]
    # Pixel centres lie at +0.5, so the box holds the centres between its sides.
    low = np.ceil(corners.min(axis=1) - 0.5).clip(0).astype(np.int64)
    high = np.floor(corners.max(axis=1) - 0.5).clip(max=(width - 1, height - 1)).astype(np.int64)
    extent = high - low + 1
    drawn = np.flatnonzero((extent > 0).all(axis=1))
    corners, low, extent = corners[drawn], low[drawn], extent[drawn]
    count = extent[:, 0] * extent[:, 1]
    triangle = np.repeat(np.arange(len(drawn)), count)
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
    columns = low[triangle, 0] + within % extent[triangle, 0]
    rows = low[triangle, 1] + within // extent[triangle, 0]
    inside = _inside(corners, triangle, columns + 0.5, rows + 0.5)
    covered[rows[inside], columns[inside]] = True
    return covered


def _inside(
    corners: NDArray[np.float64],
    triangle: NDArray[np.int64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether points lie on one side of all three edges of their triangle, whichever winding."""
    edges = np.roll(corners, -1, axis=1) - corners
    # Sides are affine in the point: a x + b y + c, one coefficient per edge and triangle.
    a, b = -edges[..., 1], edges[..., 0]
    c = -(a * corners[..., 0] + b * corners[..., 1])
    side = a[triangle] * x[:, None] + b[triangle] * y[:, None] + c[triangle]
    return (side >= 0).all(axis=1) | (side <= 0).all(axis=1)


def overlap(first: Mask, second: Mask) -> NDArray[np.float64]:
    """Intersection over union of masks (..., H, W) per frame; 1 where both are empty."""
    union = (first | second).sum(axis=(-2, -1))
    intersection = (first & second).sum(axis=(-2, -1))
    return np.where(union > 0, intersection / np.maximum(union, 1), 1.0)
