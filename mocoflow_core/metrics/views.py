"""Which views are scored: evenly spread at the end, a small seeded draw along the curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

View = tuple[str, int]  # camera name, source frame number


def spread_frames(frame_indices: NDArray[np.integer], count: int) -> list[int]:
    """At most ``count`` of the frames, evenly spread, first and last among them."""
    total = len(frame_indices)
    if total <= count:
        return [int(index) for index in frame_indices]
    rows = np.unique(np.linspace(0, total - 1, count).round().astype(int))
    return [int(frame_indices[row]) for row in rows]


def draw_views(views: Sequence[View], count: int, seed: int) -> list[View]:
    """At most ``count`` of the views, drawn once by ``seed``, in their given order.

    Every camera enters before any camera enters again, so that few views see many sides.
    """
    generator = np.random.default_rng(seed)
    queues: dict[str, list[View]] = {}
    for position in generator.permutation(len(views)):
        view = views[position]
        queues.setdefault(view[0], []).append(view)
    chosen: list[View] = []
    while len(chosen) < min(count, len(views)):
        for queue in queues.values():
            if queue and len(chosen) < count:
                chosen.append(queue.pop())
    return [view for view in views if view in set(chosen)]
