"""Which part of each People-Snapshot video is used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError


class Clip(NamedTuple):
    """Source frames ``first`` to ``first + frames - 1``."""

    first: int
    frames: int


# The training frames of Neural Body's configurations. The paper's "around 115 frames" at half the
# rate are half of its 230, so these are most likely the paper's clips too.
CLIPS = {
    "female-1-casual": Clip(0, 250),
    "female-3-casual": Clip(0, 230),
    "female-4-casual": Clip(10, 200),
    "female-6-plaza": Clip(0, 240),
    "female-7-plaza": Clip(0, 185),
    "female-8-plaza": Clip(0, 200),
    "male-2-casual": Clip(0, 180),
    "male-2-outdoor": Clip(0, 150),
    "male-3-casual": Clip(0, 235),
    "male-5-outdoor": Clip(0, 295),
}


def choose_clip(
    subject: str, first: int | None, frames: int | None, available: int
) -> tuple[NDArray[np.int32], str]:
    """Source numbers, and in words where they come from.

    What is not given is taken from ``CLIPS``, or is all there is. Raises InputError where a given
    range does not lie in the ``available`` frames.
    """
    known = CLIPS.get(subject, Clip(0, available))
    start = known.first if first is None else first
    count = known.frames if frames is None else frames
    if first is not None and frames is None:
        count = min(count, available - start)
    if not (0 <= start < available and start + count <= available):
        if first is None and frames is None:
            return np.arange(available, dtype=np.int32), (
                f"all {available} frames: fewer than the usual clip {known.first} to "
                f"{known.first + known.frames - 1}"
            )
        raise InputError(
            f"first_frame and frames must choose from the frames 0 to {available - 1}",
            f"{start} to {start + count - 1}",
            "Choose fewer.",
        )
    origin = "as chosen"
    if first is None and frames is None:
        origin = "Neural Body's clip of this subject" if subject in CLIPS else "all there are"
    numbers = np.arange(start, start + count, dtype=np.int32)
    return numbers, f"frames {start} to {start + count - 1}, {origin}"
