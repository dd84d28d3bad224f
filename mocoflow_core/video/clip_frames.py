"""Which frames of a video are taken: a clip of it, evenly in time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_selection import WHOLE_RATIO_TOLERANCE
from mocoflow_core.capture.frame_source import IMAGE_SUFFIXES, Image
from mocoflow_core.errors import InputError
from mocoflow_core.io.video import read_frames
from mocoflow_core.io.video_facts import VideoFacts
from mocoflow_core.video.configuration import VideoConfig

# Fewer show no movement.
LEAST_FRAMES = 10
# Of the usual time from frame to frame; stamps of a constant rate are rounded by less.
UNEVEN = 0.3
OTHER_PART = "--clip 5-20, in seconds"


@dataclass(frozen=True, eq=False)
class ClipFrames:
    """Frames of a video, evenly in time, no larger than asked for.

    ``indices`` are numbers of the video where every frame of it is taken, or else count the taken
    ones from 0; ``numbers`` are always the video's.
    """

    path: Path
    indices: NDArray[np.int32]  # (N,) ascending
    numbers: NDArray[np.int32]  # (N,) in the video; one may come twice where the video stood still
    rate: float
    max_side: int

    @property
    def files(self) -> list[Path]:
        return [self.path]

    @property
    def fps(self) -> float | None:
        return self.rate

    @cached_property
    def video_size(self) -> tuple[int, int]:
        """Width and height of the upright pictures of the video."""
        _, picture = next(read_frames(self.path, [int(self.numbers[0])]))
        return picture.shape[1], picture.shape[0]

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height of the frames given."""
        width, height = self.video_size
        shrink = min(1.0, self.max_side / max(width, height))
        return round(width * shrink), round(height * shrink)

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        """The wanted frames one at a time, ascending."""
        chosen = np.isin(self.indices, sorted(wanted))
        indices, numbers = self.indices[chosen], self.numbers[chosen]
        row = 0
        for number, picture in read_frames(self.path, set(numbers.tolist())):
            shown = picture
            if (picture.shape[1], picture.shape[0]) != self.size:
                shown = np.asarray(cv2.resize(picture, self.size, interpolation=cv2.INTER_AREA))
            while row < len(numbers) and numbers[row] == number:
                yield int(indices[row]), shown
                row += 1

    def part(self, first: int, last: int) -> ClipFrames:
        """The frames from one row to another, both included."""
        rows = slice(first, last + 1)
        return ClipFrames(
            self.path, self.indices[rows], self.numbers[rows], self.rate, self.max_side
        )


def choose_frames(
    path: Path, facts: VideoFacts, configuration: VideoConfig
) -> tuple[ClipFrames, str]:
    """The clip's frames at no more than the wanted rate; and in words what was done.

    Where the video has no constant rate, the frames nearest to evenly spaced times are taken.
    Raises InputError for a still picture, a clip outside the video, too long or too short.
    """
    rows = _within(path, facts.times_s, configuration)
    times = facts.times_s[rows]
    steps = np.diff(times)
    step = float(np.median(steps))
    if step <= 0:
        raise InputError("a video whose time stamps grow", "equal ones", "Re-encode the video.")
    uneven = np.abs(steps - step).max() > UNEVEN * step
    mean = step if uneven else float(steps.mean())
    if not uneven:
        stride = max(1, int(np.ceil(1 / (mean * configuration.fps) - WHOLE_RATIO_TOLERANCE)))
        numbers, rate = rows[::stride], 1 / (mean * stride)
        said = f"{len(numbers)} frames, {rate:.3g} per second"
        said += f": one in {stride} of the video's {1 / mean:.3g} per second" * (stride > 1)
    else:
        rate = min(1 / step, configuration.fps)
        wanted = np.arange(times[0], times[-1], 1 / rate)
        nearest = _nearest(times, wanted)
        off_ms = 1000 * float(np.abs(times[nearest] - wanted).max())
        numbers, stride = rows[nearest], 0
        said = (
            f"the video's rate varies ({1 / steps.max():.3g} to {1 / steps.min():.3g} per second): "
            f"{len(numbers)} frames nearest to even times, {rate:.3g} per second, off by at most "
            f"{off_ms:.0f} ms"
        )
    _require_enough(len(numbers))
    indices = numbers if stride == 1 else np.arange(len(numbers))
    frames = ClipFrames(
        path, indices.astype(np.int32), numbers.astype(np.int32), rate, configuration.max_side
    )
    return frames, said


def _nearest(times: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.int64]:
    """For each wanted time the row of the nearest of the ascending ones, the earlier of two."""
    after = np.searchsorted(times, wanted).clip(1, len(times) - 1)
    return after - (wanted - times[after - 1] <= times[after] - wanted)


def _within(
    path: Path, times: NDArray[np.float64], configuration: VideoConfig
) -> NDArray[np.int64]:
    """Numbers of the video's frames between start and end."""
    if path.suffix.lower() in IMAGE_SUFFIXES or len(times) == 1:
        raise InputError("a video", f"the still picture {path.name}", "Film for some seconds.")
    end = times[-1] if configuration.end_s is None else configuration.end_s
    start = configuration.start_s
    rows = np.flatnonzero((times >= start - 1e-6) & (times <= end + 1e-6))
    if not len(rows):
        raise InputError(
            f"a clip within the video's {times[-1]:.1f} s",
            f"{start:g} to {end:g} s",
            f"Choose another part: {OTHER_PART}.",
        )
    length = times[rows[-1]] - times[rows[0]]
    if length > configuration.longest_s:
        raise InputError(
            f"a clip of at most {configuration.longest_s:g} s",
            f"{length:.0f} s",
            f"Choose a part of the video: {OTHER_PART}.",
        )
    _require_enough(len(rows))
    return rows


def _require_enough(count: int) -> None:
    if count < LEAST_FRAMES:
        raise InputError(
            f"a clip of at least {LEAST_FRAMES} frames", f"{count}", "Film for some seconds."
        )
