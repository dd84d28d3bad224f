"""Which part of each People-Snapshot video is used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.clip_range import ClipRange
from mocoflow_core.errors import InputError

# The training frames of Neural Body's configurations. The paper's "around 115 frames" at half the
# rate are half of its 230, so these are most likely the paper's clips too.
CLIPS = {
    "female-1-casual": ClipRange(0, 250),
    "female-3-casual": ClipRange(0, 230),
    "female-4-casual": ClipRange(10, 200),
    "female-6-plaza": ClipRange(0, 240),
    "female-7-plaza": ClipRange(0, 185),
    "female-8-plaza": ClipRange(0, 200),
    "male-2-casual": ClipRange(0, 180),
    "male-2-outdoor": ClipRange(0, 150),
    "male-3-casual": ClipRange(0, 235),
    "male-5-outdoor": ClipRange(0, 295),
}


def choose_clip(
    subject: str, first: int | None, frames: int | None, available: int
) -> tuple[NDArray[np.int32], str]:
    """Source numbers, and in words where they come from.

    What is not given is taken from ``CLIPS``, or is all there is. Raises InputError where a given
    range does not lie in the ``available`` frames.
    """
    usual = CLIPS.get(subject, ClipRange(0, available))
    start = usual.start if first is None else first
    length = usual.length if frames is None else frames
    if first is not None and frames is None:
        length = min(length, available - start)
    wanted = ClipRange(start, length)
    if not (0 <= start < available and start + length <= available):
        if first is None and frames is None:
            whole = np.arange(available, dtype=np.int32)
            return whole, f"all {available} frames: fewer than the usual clip {usual}"
        raise InputError(
            f"first_frame and frames must choose from the frames 0 to {available - 1}",
            f"{wanted}",
            "Choose fewer.",
        )
    origin = "as chosen"
    if first is None and frames is None:
        origin = "Neural Body's clip of this subject" if subject in CLIPS else "all there are"
    return wanted.numbers, f"frames {wanted}, {origin}"
