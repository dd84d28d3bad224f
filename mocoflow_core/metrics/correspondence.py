"""Does the motion carry a true point of one frame to the same true point of another?"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError

Points = NDArray[np.float64]
# World points (N, 3) and the source number of a frame -> points (N, 3), all in metres.
MotionMap = Callable[[Points, int], Points]

MM_PER_M = 1000.0


def carry(
    points: Points,
    from_frame: int,
    to_frame: int,
    to_canonical: MotionMap,
    to_observed: MotionMap,
) -> Points:
    """Points (N, 3) of one frame, moved to another through the canonical space.

    What the canonical space itself looks like cancels: this is free of its gauge.
    """
    return to_observed(to_canonical(points, from_frame), to_frame)


def correspondence_mm(
    truth: Points,
    frame_indices: NDArray[np.integer],
    pairs: Sequence[tuple[int, int]],
    to_canonical: MotionMap,
    to_observed: MotionMap,
) -> NDArray[np.float64]:
    """Mean distance in mm between carried and true points, one value for each pair.

    Args:
        truth: (T, N, 3) world metres; point n is the same surface point in every frame.
        frame_indices: (T,) source numbers of the frames.
        pairs: (from, to) source numbers; the value belongs to the frame ``to``.

    Raises:
        InputError: no points, or a pair's frame that has no truth.
    """
    rows = {int(index): row for row, index in enumerate(frame_indices)}
    missing = {frame for pair in pairs for frame in pair} - rows.keys()
    if missing or truth.shape[1] == 0:
        raise InputError(
            "truth points in both frames of every pair",
            f"none at frames {sorted(missing)}" if missing else "no points",
            "Choose pairs among the truth's frame_indices.",
        )
    errors = [
        np.linalg.norm(
            carry(truth[rows[start]], start, end, to_canonical, to_observed) - truth[rows[end]],
            axis=-1,
        ).mean()
        for start, end in pairs
    ]
    return MM_PER_M * np.asarray(errors, np.float64)


def draw_pairs(
    frame_indices: NDArray[np.integer], sources: int, seed: int
) -> list[tuple[int, int]]:
    """For each frame, ``sources`` others to be carried from, drawn by ``seed``."""
    generator = np.random.default_rng(seed)
    pairs = []
    for end in frame_indices:
        others = frame_indices[frame_indices != end]
        chosen = generator.choice(others, min(sources, len(others)), replace=False)
        pairs += [(int(start), int(end)) for start in np.sort(chosen)]
    return pairs
