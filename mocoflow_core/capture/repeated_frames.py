"""Frames that show again what the one before has shown: duplicates, and a person standing still."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.progress import Progress, untold

# The person's pixels may change by so much more than the background's, and still be still:
# what changes there is the camera's noise.
NOISE_RATIO = 1.3
# And by this in any case, of 255: rounding, where there is no noise at all.
ROUNDING = 0.25
# A background that changes by more than noise does, of 255, is another picture: nothing repeats.
LARGEST_NOISE = 4.0


def repeated_frames(
    frames: NDArray[np.uint8],
    masks: NDArray[np.bool_],
    working: NDArray[np.bool_],
    progress: Progress = untold,
) -> NDArray[np.bool_]:
    """Which working frames (T,) repeat the last one that is kept.

    The first and the last frame are kept, so that the clip stays as long as it is.

    Args:
        frames: (T, H, W, 3).
        masks: (T, H, W) true on the person.
        working: (T,) the frames that may be left out; others are not looked at.
    """
    repeated = np.zeros(len(frames), bool)
    rows = np.flatnonzero(working)
    if not len(rows):
        return repeated
    kept = rows[0]
    for row in rows[1:-1]:
        progress(row / len(frames), "frames compared")
        repeated[row] = _shows_the_same(frames[kept], frames[row], masks[kept] | masks[row])
        kept = kept if repeated[row] else row
    return repeated


def _shows_the_same(
    first: NDArray[np.uint8], second: NDArray[np.uint8], person: NDArray[np.bool_]
) -> bool:
    changes = np.abs(first.astype(np.int16) - second).mean(axis=-1)
    if not person.any():
        return bool(changes.mean() <= ROUNDING)
    # The median: a screen or a passer-by that fills less than half of the background is no noise.
    noise = float(np.median(changes[~person])) if not person.all() else 0.0
    still = noise <= LARGEST_NOISE
    return bool(still and changes[person].mean() <= NOISE_RATIO * noise + ROUNDING)
