"""The 60 Hz grid that AIST++ annotations sit on, and the video frame that each of its ticks shows.

Frame numbers of AIST scenes count this grid from 0. For videos of exactly 60 frames per second they
are the numbers of the video's frames; others (59.94) repeat or drop one now and then.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_source import Image
from mocoflow_core.io.video import VideoDescription, describe_video, read_frames

Rounding = Literal["down", "up"]
GRID_FPS = 60.0
# Containers state their rate to about this; such a video drifts by a frame in ten thousand.
_SAME_RATE = 1e-4


def shown_frames(ticks: NDArray[np.int32], fps: float, rounding: Rounding) -> NDArray[np.int64]:
    """The frame of a video that each tick shows, as ffmpeg's ``fps=60:round=down`` (or ``up``).

    Frame j is moved to tick floor (or ceil) of 60 j / fps; a tick shows the latest frame that was
    moved to it or before it.
    """
    if abs(fps / GRID_FPS - 1) <= _SAME_RATE:
        return ticks.astype(np.int64)
    per_tick = fps / GRID_FPS
    if rounding == "up":
        return np.floor(ticks * per_tick).astype(np.int64)
    return np.ceil((ticks + 1) * per_tick).astype(np.int64) - 1


def ticks_of(description: VideoDescription, rounding: Rounding) -> NDArray[np.int32]:
    """All ticks that a video has a frame for, from 0."""
    most = int(np.ceil(description.frame_count * GRID_FPS / description.fps)) + 1
    ticks = np.arange(most, dtype=np.int32)
    shown = shown_frames(ticks, description.fps, rounding)
    return ticks[shown < description.frame_count]


@dataclass(frozen=True, eq=False)
class GridFrames:
    """Frames of a video by tick of the 60 Hz grid."""

    path: Path
    indices: NDArray[np.int32]  # (N,) ascending
    rounding: Rounding = "down"

    @cached_property
    def description(self) -> VideoDescription:
        return describe_video(self.path)

    @property
    def files(self) -> list[Path]:
        return [self.path]

    @property
    def fps(self) -> float | None:
        return GRID_FPS

    def shown(self, wanted: Collection[int]) -> dict[int, int]:
        """The number of the video's frame for each wanted tick, ascending."""
        ticks = np.array(sorted(wanted), np.int32)
        frames = shown_frames(ticks, self.description.fps, self.rounding)
        return dict(zip(ticks.tolist(), frames.tolist(), strict=True))

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        shown = self.shown(wanted)
        decoded = read_frames(self.path, set(shown.values()))
        number, image = -1, None
        for tick, frame in shown.items():
            while number < frame:
                number, image = next(decoded)
            assert image is not None
            yield tick, image
