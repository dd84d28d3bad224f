"""Frames of the train camera above the places of their points on the body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocoflow_core.capture.clip import Clip
from mocoflow_core.metrics.score import on_white
from mocoflow_core.report.inputs import ReportInputs
from mocoflow_core.report.pictures import (
    NEARLY_WHITE,
    Picture,
    cut_to_person,
    data_uri,
    read_picture,
    webps_within,
)

BUDGET_BYTES = 800_000


class Correspondence(NamedTuple):
    """One frame; pictures as data URIs."""

    frame_index: int
    is_canonical: bool
    photograph: str
    colours: str


def correspondences(inputs: ReportInputs) -> list[Correspondence]:
    """The canonical frame first, then the others in their order; empty without pictures."""
    clip, folder = inputs.seen, inputs.correspondences
    if clip is None or folder is None:
        return []
    canonical = inputs.canonical_frame
    found = [int(i) for i in clip.frame_indices if (folder / f"{i:06d}.png").is_file()]
    frames = sorted(found, key=lambda frame: (frame != canonical, frame))
    coloured = [read_picture(folder / f"{frame:06d}.png") for frame in frames]
    pairs = [[_person(clip, *shown), shown[1]] for shown in zip(frames, coloured, strict=True)]
    pictures = [picture for pair in cut_to_person(pairs) for picture in pair]
    uris = [data_uri(file, "image/webp") for file in webps_within(pictures, BUDGET_BYTES)]
    return [
        Correspondence(frame, frame == canonical, *both)
        for frame, *both in zip(frames, uris[::2], uris[1::2], strict=True)
    ]


def _person(clip: Clip, frame: int, coloured: Picture) -> Picture:
    """The photograph over white; without a mask, as far as there are colours."""
    row = int(np.searchsorted(clip.frame_indices, frame))
    mask = clip.masks[row] if clip.has_mask[row] else coloured.min(axis=-1) < NEARLY_WHITE
    return np.round(255.0 * on_white(clip.frames[row], mask)).astype(np.uint8)
