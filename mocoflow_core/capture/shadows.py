"""How much of what is behind the person lies in a shadow that the plate does not have."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.clip import Clip

# Frames looked at, spread over the clip.
LOOKED_AT = 12
# The person's own edge is no shadow: masks grow by this share of the longer side.
MARGIN = 0.015
# A shadow takes at least this share of the light, and from all colours alike to this factor.
LEAST_DROP = 0.08
LARGEST_TINT = 0.15
# Steps of 1/255 by which a pixel must have darkened at least: below is noise.
LEAST_STEPS = 6


def shadowed_area(clip: Clip) -> float:
    """Median area in shadow over some training frames, in sizes of the person; 0 where unknown.

    Light that is missing in all frames is part of the plate and counts for nothing.
    """
    rows = np.flatnonzero(~clip.held_out & clip.masks.any(axis=(1, 2)))
    if not len(rows):
        return 0.0
    chosen = rows[np.linspace(0, len(rows) - 1, min(LOOKED_AT, len(rows))).round().astype(int)]
    shares = [
        shadow(np.asarray(clip.frames[row]), np.asarray(clip.masks[row]), clip.background).sum()
        / clip.masks[row].sum()
        for row in chosen
    ]
    return float(np.median(shares))


def shadow(
    frame: NDArray[np.uint8], mask: NDArray[np.bool_], plate: NDArray[np.uint8]
) -> NDArray[np.bool_]:
    """Pixels (H, W) off the person that are the plate's colour with less light."""
    side = 2 * max(round(MARGIN * max(mask.shape)), 1) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    outside = cv2.dilate(mask.astype(np.uint8), kernel) == 0
    before, now = plate.astype(np.float32), frame.astype(np.float32)
    ratio = (now + 1) / (before + 1)
    least, most = ratio.min(axis=-1), ratio.max(axis=-1)
    darker = (most < 1 - LEAST_DROP) & ((before - now).mean(axis=-1) >= LEAST_STEPS)
    grey = most - least < LARGEST_TINT
    alike = (outside & darker & grey).astype(np.uint8)
    # Single pixels are noise.
    return cv2.morphologyEx(alike, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
