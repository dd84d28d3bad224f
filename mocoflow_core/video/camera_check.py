"""Whether the camera of a video stands still, and whether anything moves at all."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.background_motion import background_motion_px
from mocoflow_core.errors import InputError

Frames = NDArray[np.uint8]  # (T, H, W, 3)
Masks = NDArray[np.bool_]  # (T, H, W)

# Measured on pictures of this size, in pixels of the full one.
LONGER_SIDE = 640
# Of the longer side: from here on there is a word of caution, and from there on no scene.
NOTICEABLE, TOO_MUCH = 0.001, 0.01
# Compression makes a still picture differ by less than this in the mean, of 255.
STILL = 0.6


def require_still_camera(frames: Frames, masks: Masks) -> tuple[float, str]:
    """The largest motion of the background, pixels of ``frames``; and in words.

    Raises InputError where the camera was carried.
    """
    height, width = frames.shape[1:3]
    shrink = min(1.0, LONGER_SIDE / max(height, width))
    size = (round(width * shrink), round(height * shrink))
    small = np.stack([cv2.resize(f, size, interpolation=cv2.INTER_AREA) for f in frames])
    covered = np.stack([cv2.resize(m.astype(np.uint8), size) > 0 for m in masks])
    moved = background_motion_px(small, covered) / shrink
    share = moved / max(height, width)
    said = f"the background moves by {moved:.1f} px, {100 * share:.2f} % of the picture"
    if not np.isfinite(moved):
        return moved, "caution: the background is too plain to show whether the camera stands still"
    if share > TOO_MUCH:
        raise InputError(
            f"a camera that stands still (background motion below {100 * TOO_MUCH:g} %)",
            f"a moving one: {said}",
            "Film with the phone on something firm, or choose a part with --clip.",
        )
    return moved, f"caution: {said}: the camera should stand still" * (share > NOTICEABLE) or said


def require_movement(frames: Frames, masks: Masks) -> None:
    """Raise InputError where all frames show the same picture."""
    person = masks.any(0)
    if not person.any():
        person = np.ones_like(person)
    changes = [
        float(np.abs(frame.astype(np.int16) - frames[0])[person].mean()) for frame in frames[1:]
    ]
    if max(changes, default=0.0) < STILL:
        raise InputError(
            "a video of somebody who moves",
            "the same still picture in all frames",
            "Film somebody who turns around or moves.",
        )
