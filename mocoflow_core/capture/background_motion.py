"""Whether the camera stands still: how far the background moves between frames."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Frames = NDArray[np.uint8]  # (T, H, W, 3)
Masks = NDArray[np.bool_]  # (T, H, W), true on the person

# Patches of the smaller image side; large enough for a sharp correlation peak.
PATCH_SHARE = 0.25
# A smaller patch has no peak to speak of.
LEAST_PATCH_PX = 4
# Below this standard deviation (of 255) a patch shows nothing that could be seen moving.
LEAST_TEXTURE = 4.0


def background_motion_px(frames: Frames, masks: Masks) -> float:
    """Largest shift of the background against the first frame, pixels; nan when nothing shows it.

    Phase correlation of patches which the person covers in neither frame, the median over patches:
    something that moves in one corner of the background is no moving camera.
    """
    side = int(PATCH_SHARE * min(frames.shape[1:3]))
    if side < LEAST_PATCH_PX:
        return float("nan")
    grey = np.stack([cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY) for frame in frames])
    grey = grey.astype(np.float64)
    shifts = [
        _median_shift(grey[0], grey[row], masks[0] | masks[row], side)
        for row in range(1, len(grey))
    ]
    seen = [shift for shift in shifts if np.isfinite(shift)]
    return max(seen, default=float("nan"))


def _median_shift(
    first: NDArray[np.float64], second: NDArray[np.float64], covered: NDArray[np.bool_], side: int
) -> float:
    window = cv2.createHanningWindow((side, side), cv2.CV_64F)
    shifts = []
    for top in range(0, first.shape[0] - side + 1, side // 2):
        for left in range(0, first.shape[1] - side + 1, side // 2):
            patch = np.s_[top : top + side, left : left + side]
            if covered[patch].any() or first[patch].std() < LEAST_TEXTURE:
                continue
            # OpenCV writes the window into what it is given, hence the copies.
            shift, _ = cv2.phaseCorrelate(first[patch].copy(), second[patch].copy(), window)
            shifts.append(shift)
    if not shifts:
        return float("nan")
    return float(np.linalg.norm(np.median(shifts, axis=0)))
