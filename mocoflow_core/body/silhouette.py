"""The outline of a body in an image: which pixels its mesh covers, and how well they agree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera

Mask = NDArray[np.bool_]
# A triangle nearer than this is not drawn: its projection is meaningless.
NEAR_M = 0.05
SEAM_PX = 1e-9


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

    Each triangle covers one span in each row it meets; starts and ends of all spans are counted
    and summed along the rows.
    """
    corners = pixels[faces]
    # Pixel centres lie at +0.5, so rows from ceil to floor have their centres in the triangle.
    top = np.ceil(corners[..., 1].min(axis=1) - 0.5).clip(0, height).astype(np.int64)
    bottom = np.floor(corners[..., 1].max(axis=1) - 0.5).clip(-1, height - 1).astype(np.int64)
    count = (bottom - top + 1).clip(0)
    triangle = np.repeat(np.arange(len(faces)), count)
    row = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count - top, count)
    left, right = _span(corners, triangle, row + 0.5)
    start = np.ceil(left - 0.5).clip(0, width).astype(np.int64)
    end = np.floor(right - 0.5).clip(-1, width - 1).astype(np.int64) + 1
    seen = start < end
    size = height * (width + 1)
    starts = np.bincount(row[seen] * (width + 1) + start[seen], minlength=size)
    ends = np.bincount(row[seen] * (width + 1) + end[seen], minlength=size)
    covering = np.cumsum((starts - ends).reshape(height, width + 1), axis=1)
    return covering[:, :width] > 0


def _span(
    corners: NDArray[np.float64], triangle: NDArray[np.int64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """From where to where each triangle reaches at height ``y``, whichever way it winds."""
    edges = np.roll(corners, -1, axis=1) - corners
    winding = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    turned = np.where(winding < 0, -1.0, 1.0)[:, None]
    falling = turned * edges[..., 1]
    slope = edges[..., 0] / np.where(edges[..., 1] == 0, np.inf, edges[..., 1])
    crossing = corners[..., 0] - corners[..., 1] * slope
    left, right = np.full(len(y), -np.inf), np.full(len(y), np.inf)
    for edge in range(3):
        x = crossing[triangle, edge] + slope[triangle, edge] * y
        direction = falling[triangle, edge]
        # With y down and this winding, edges that run up bound the left, those down the right.
        np.maximum(left, x, out=left, where=direction < 0)
        np.minimum(right, x, out=right, where=direction > 0)
    # Neighbours share an edge up to rounding; no centre may fall between them.
    return left - SEAM_PX, right + SEAM_PX


def overlap(first: Mask, second: Mask) -> NDArray[np.float64]:
    """Intersection over union of masks (..., H, W) per frame; 1 where both are empty."""
    union = (first | second).sum(axis=(-2, -1))
    intersection = (first & second).sum(axis=(-2, -1))
    return np.where(union > 0, intersection / np.maximum(union, 1), 1.0)
