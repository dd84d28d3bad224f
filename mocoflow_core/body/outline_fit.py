"""Where a body stands, precisely: its outline is laid onto the mask's."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.agreement import signed_distance
from mocoflow_core.body.mask_crop import MaskCrop

Array = NDArray[np.float64]

# Points farther off than this many times the usual distance count less: limbs in another pose.
ROBUST_FACTOR = 2.0
# The gradient of a distance has length 1; much less shows a ridge between two outlines.
LEAST_GRADIENT = 0.7
# Masks are sharp to about half a pixel, so residuals below count fully.
LEAST_SCALE_PX = 0.5
# The outline is known to a fraction of a pixel; a smaller step changes nothing.
SMALL_STEP_PX = 0.02
SMALL_STEP_SHARE = 5e-4
# Too few points leave the four unknowns open.
LEAST_POINTS = 20


def fit_outline(
    points: Array,
    faces: NDArray[np.int32],
    crop: MaskCrop,
    start: Array,
    iterations: int,
) -> Array:
    """Translation (3,) that lays the outline of the body (V, 3) onto that of the crop's mask.

    Gauss-Newton on the distances of the drawn outline to the mask's, together with one offset
    that all of them share: clothes, and masks drawn wide or narrow, move the whole outline outward
    and say nothing of the distance. Returns the best translation met, ``start`` among them.
    """
    distance = signed_distance(crop.coverage > 0.5)
    slope_x, slope_y = np.gradient(distance, axis=1), np.gradient(distance, axis=0)
    best, least = start, np.inf
    translation = start
    for _ in range(iterations + 1):
        rows, columns = np.nonzero(_outline(crop.draw(points + translation, faces)))
        off = distance[rows, columns].astype(np.float64)
        slope = np.stack([slope_x[rows, columns], slope_y[rows, columns]], axis=-1)
        length = np.linalg.norm(slope, axis=-1)
        clear = np.isfinite(off) & (length > LEAST_GRADIENT)
        if clear.sum() < LEAST_POINTS:
            break
        off = off[clear]
        unlike = float(np.mean(np.abs(off - np.median(off))))
        if unlike < least:
            best, least = translation, unlike
        pixels = np.stack([columns, rows], axis=-1)[clear] + 0.5
        depth = float((points.mean(axis=0) + translation)[2])
        step = _step(off, slope[clear] / length[clear, None], pixels, depth, crop.K)
        translation = translation + step
        step_px = np.abs(step[:2]).max() * crop.focal_px / depth
        if step_px < SMALL_STEP_PX and abs(step[2]) < SMALL_STEP_SHARE * depth:
            break
    return best


def _outline(drawn: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Drawn pixels next to undrawn ones; the crop's own border is no outline."""
    image = drawn.astype(np.uint8)
    inner = cv2.erode(image, np.ones((3, 3), np.uint8), borderValue=1)
    return drawn & (inner == 0)


def _step(off: Array, normals: Array, pixels: Array, depth: float, K: Array) -> Array:
    """The move (3,) in metres that best removes the distances, the shared offset apart."""
    towards = (pixels - K[:2, 2]) / depth
    jacobian = np.stack(
        [
            normals[:, 0] * K[0, 0] / depth,
            normals[:, 1] * K[1, 1] / depth,
            -(normals * towards).sum(axis=1),
            -np.ones(len(off)),
        ],
        axis=-1,
    )
    usual = off - np.median(off)
    scale = max(ROBUST_FACTOR * float(np.median(np.abs(usual))), LEAST_SCALE_PX)
    weights = np.sqrt(1.0 / (1.0 + (usual / scale) ** 2))
    solution, *_ = np.linalg.lstsq(jacobian * weights[:, None], -off * weights, rcond=None)
    return solution[:3]
