"""Which source frames are worked on, and which are kept for scoring."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError

Indices = NDArray[np.int32]

# 59.94 frames per second count as 60: the rate then is a whole multiple, and a little off.
WHOLE_RATIO_TOLERANCE = 0.02


@dataclass(frozen=True, eq=False)
class FrameSelection:
    """Source numbers at the working rate, and the held-out ones beside them."""

    working: Indices
    held_out: Indices
    fps: float  # of the working frames

    @property
    def all(self) -> Indices:
        return np.union1d(self.working, self.held_out).astype(np.int32)

    def among(self, frames: Indices) -> FrameSelection:
        """Those that are also among the given source numbers."""
        working, held_out = (part[np.isin(part, frames)] for part in (self.working, self.held_out))
        return FrameSelection(working, held_out, self.fps)


def select_frames(
    available: Indices,
    source_fps: float,
    working_fps: float,
    scorable: Indices,
    held_out_frames: int,
    holdout_every: int,
) -> FrameSelection:
    """Thin out the source frames to the working rate, never above the source's.

    Where the source rate is a multiple of the working rate, up to ``held_out_frames`` of the
    ``scorable`` frames half-way between are held out, at no cost. Otherwise every
    ``holdout_every``-th working frame is (0: none).
    """
    stride = _stride(source_fps, working_fps)
    steps = np.arange(int(np.ceil(len(available) / stride)))
    positions = np.floor(steps * stride + 0.5 * (stride % 1 > 0)).astype(int)
    working = available[positions[positions < len(available)]]
    if stride >= 2 and stride % 1 == 0:
        half_way = positions[:-1] + int(stride) // 2
        between = np.intersect1d(available[half_way], scorable)
        held_out = _spread(between, held_out_frames)
    else:
        offset = holdout_every // 2
        held_out = working[offset::holdout_every] if holdout_every else working[:0]
    return FrameSelection(working, held_out.astype(np.int32), source_fps / stride)


def require_contiguous(indices: Indices, what: str) -> None:
    """Raise InputError when a number between the first and the last is missing."""
    missing = np.setdiff1d(np.arange(indices[0], indices[-1] + 1), indices)
    if len(missing):
        raise InputError(
            f"{what} must be complete from {indices[0]} to {indices[-1]}",
            f"no frame {missing[0]} ({len(missing)} missing)",
            "Add the missing frames, or cut the clip before the gap.",
        )


def _stride(source_fps: float, working_fps: float) -> float:
    ratio = max(source_fps / working_fps, 1.0)
    whole = round(ratio)
    return float(whole) if abs(ratio - whole) <= WHOLE_RATIO_TOLERANCE * ratio else ratio


def _spread(candidates: Indices, count: int) -> Indices:
    """At most ``count`` of the candidates, evenly over them, each from the middle of its share."""
    if count >= len(candidates):
        return candidates
    middles = (np.arange(count) + 0.5) * len(candidates) / max(count, 1)
    return candidates[middles.astype(int)]
