"""How far the outline of a body lies from the mask of the person, in pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Distances = NDArray[np.float32]
# Masks this close to the image border are cut by it: their outline there is no outline.
BORDER_PX = 1


def signed_distance(mask: Mask) -> Distances:
    """Distance of each pixel centre (H, W) to the edge of the mask: positive outside, pixels.

    The edge lies half-way between the centres of pixels on either side.
    """
    if not mask.any() or mask.all():
        return np.full(mask.shape, np.inf if not mask.any() else -np.inf, np.float32)
    inner = mask.astype(np.uint8)
    outside = cv2.distanceTransform(1 - inner, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inside = cv2.distanceTransform(inner, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.where(mask, 0.5 - inside, outside - 0.5)


def outside_distances(mask: Mask, body: Mask) -> Distances:
    """For each pixel of the mask outside the body, how far outside (N,), pixels."""
    if not body.any():
        return np.empty(0, np.float32)
    return signed_distance(body)[mask & ~body]


def outline_distances(mask: Mask, body: Mask) -> Distances:
    """Distances (N,) between the two outlines, measured from the mask's to the body's, pixels.

    The outline where the image cuts the person is left out.
    """
    if not body.any() or not mask.any():
        return np.empty(0, np.float32)
    inner = mask.astype(np.uint8)
    edge = (inner > 0) & (cv2.erode(inner, np.ones((3, 3), np.uint8)) == 0)
    edge[:BORDER_PX] = edge[-BORDER_PX:] = False
    edge[:, :BORDER_PX] = edge[:, -BORDER_PX:] = False
    # The outline's own pixels lie half a pixel inside.
    return np.abs(signed_distance(body)[edge] + 0.5)


def is_cut(mask: Mask) -> bool:
    """Whether the image border cuts the person."""
    return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())
