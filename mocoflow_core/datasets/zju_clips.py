"""Which frames of a ZJU-MoCap subject are used."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.clip_range import ClipRange
from mocoflow_core.errors import InputError

Indices = NDArray[np.int32]


# Training ranges of Neural Body (configs/zju_mocap_exp); 313 and 315 count from 1. The paper's
# "about 150 frames" at half the rate are the 300 of most subjects.
USUAL_CLIP = ClipRange(0, 300)
CLIPS = {
    "313": ClipRange(1, 60),
    "315": ClipRange(1, 400),
    "390": ClipRange(700, 300),
    "396": ClipRange(810, 540),
}
# Source frames whose distributed masks are known to be wrong, first and last.
BAD_MASKS = {"387": (360, 370)}


def subject_of(names: Iterable[PurePath | str]) -> str | None:
    """The subject's number, from the first name that says ``CoreView_<number>``."""
    for name in names:
        if found := re.search(r"CoreView_(\d+)", str(name)):
            return found[1]
    return None


def chosen_range(subject: str | None, start: int | None, length: int | None) -> ClipRange:
    """The subject's usual range where nothing else is asked for."""
    usual = CLIPS.get(subject or "", USUAL_CLIP)
    return ClipRange(
        usual.start if start is None else start, usual.length if length is None else length
    )


def unbroken_clip(
    wanted: ClipRange, pictures: Indices, masked: Indices
) -> tuple[Indices, tuple[str, ...]]:
    """The longest run of frames in the range that have a picture and a mask, and remarks.

    A clip that is learned from has no gaps, so what lies beyond one is left out.

    Raises InputError when there is no such frame.
    """
    usable = wanted.among(masked)
    if not len(usable):
        there = f"{pictures[0]} to {pictures[-1]}" if len(pictures) else "none"
        raise InputError(
            f"frames {wanted} with picture and mask in the train camera",
            f"pictures {there}, of which {len(masked)} have a mask",
            "Choose others with first_frame and frames, or add the masks.",
        )
    runs = np.split(usable, np.flatnonzero(np.diff(usable) != 1) + 1)
    clip = max(runs, key=len)
    if len(clip) == wanted.length:
        return clip, ()
    remark = f"of the frames {wanted} the clip holds {clip[0]} to {clip[-1]}"
    if len(runs) > 1:
        remark += ", the longest run in which the train camera has pictures and masks"
    if unmasked := len(np.setdiff1d(wanted.among(pictures), masked)):
        remark += f" ({unmasked} pictures lack their mask)"
    return clip, (remark,)


def bad_masks(subject: str | None, clip: Indices) -> tuple[str, ...]:
    """A remark where the clip holds frames whose masks are known to be wrong."""
    first, last = BAD_MASKS.get(subject or "", (0, -1))
    inside = clip[(clip >= first) & (clip <= last)]
    if not len(inside):
        return ()
    return (f"the masks of frames {first} to {last} of CoreView_{subject} are known to be wrong",)
