"""Which frames of each ZJU-MoCap subject are used unless told otherwise."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import PurePath


@dataclass(frozen=True)
class ClipRange:
    """Source frames ``start`` to ``start + length - 1``."""

    start: int
    length: int


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


def subject_of(*names: PurePath | str) -> str | None:
    """The subject's number, from the first name that says ``CoreView_<number>``."""
    for name in names:
        if found := re.search(r"CoreView_(\d+)", str(name)):
            return found[1]
    return None


def usual_clip(subject: str | None) -> ClipRange:
    """The default range of a subject."""
    return CLIPS.get(subject or "", USUAL_CLIP)
