"""The two moving pictures of a report: input beside novel view, and the turntable."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from mocoflow_core.capture.clip import Clip
from mocoflow_core.io.video import read_frames, write_video
from mocoflow_core.metrics.crop import bounding_box
from mocoflow_core.report.pictures import Picture, data_uri, read_picture, webp

HEIGHT_PX = 512
NEARLY_WHITE = 250
MARGIN = 0.04  # of the person's longer side, on each side
GAP_PX = 12
# A larger file is left out of the page and named instead, so that the page stays light.
LARGEST_VIDEO_BYTES = 3_500_000


class Video(NamedTuple):
    """A video ready for the page; ``source`` is empty where the file is too large for it."""

    source: str  # data URI
    poster: str  # data URI of a picture shown before it plays
    aspect: float  # width over height
    note: str


def side_by_side(clip: Clip, novel_view: Path) -> Video | None:
    """The input and the novel view of the same frames, one video; None without common frames."""
    pairs = [
        (frame, novel_view / f"{index:06d}.png")
        for frame, index in zip(clip.frames, clip.frame_indices, strict=True)
    ]
    pairs = [pair for pair in pairs if pair[1].is_file()]
    if not pairs:
        return None
    box = _person_box([read_picture(path) for _, path in pairs])
    joined = [_joined(np.asarray(frame), read_picture(path)[box]) for frame, path in pairs]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "input_and_novel_view.mp4"
        write_video(path, joined, clip.fps)
        return _embedded(path, joined[len(joined) // 2])


def turntable(path: Path) -> Video | None:
    """A finished mp4; None where there is none."""
    if not path.is_file():
        return None
    _, first = next(iter(read_frames(path, [0])))
    return _embedded(path, first)


def _embedded(path: Path, still: Picture) -> Video:
    content = path.read_bytes()
    poster, aspect = data_uri(webp(still), "image/webp"), still.shape[1] / still.shape[0]
    if len(content) > LARGEST_VIDEO_BYTES:
        size = f"{len(content) / 1e6:.1f} MB"
        note = f"This video has {size}, too much for this page: see {path.name} beside it."
        return Video("", poster, aspect, note)
    return Video(data_uri(content, "video/mp4"), poster, aspect, "")


def _person_box(pictures: list[Picture]) -> tuple[slice, slice]:
    """Rows and columns around everything that is not white in any of the pictures."""
    inked = np.any([picture.min(axis=-1) < NEARLY_WHITE for picture in pictures], axis=0)
    if not inked.any():
        return slice(None), slice(None)
    top, left, bottom, right = bounding_box(inked)
    spare = round(MARGIN * max(bottom - top, right - left))
    return slice(max(top - spare, 0), bottom + spare), slice(max(left - spare, 0), right + spare)


def _joined(left: Picture, right: Picture) -> Picture:
    gap = np.full((HEIGHT_PX, GAP_PX, 3), 255, np.uint8)
    return np.hstack([_at_height(left), gap, _at_height(right)])


def _at_height(picture: Picture) -> Picture:
    width = max(round(picture.shape[1] * HEIGHT_PX / picture.shape[0]), 1)
    shrinks = picture.shape[0] > HEIGHT_PX
    method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, (width, HEIGHT_PX), interpolation=method), np.uint8)
