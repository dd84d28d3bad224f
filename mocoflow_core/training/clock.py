"""The training clock: wall and CPU seconds of work that makes the result better."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Seconds:
    """Elapsed time. CPU seconds are those of the whole process, all threads."""

    wall: float = 0.0
    cpu: float = 0.0

    def __add__(self, other: Seconds) -> Seconds:
        return Seconds(self.wall + other.wall, self.cpu + other.cpu)

    def __sub__(self, other: Seconds) -> Seconds:
        return Seconds(self.wall - other.wall, self.cpu - other.cpu)


def now() -> Seconds:
    return Seconds(time.perf_counter(), time.process_time())


class TrainingClock:
    """Runs from its creation on; stops while the scene is evaluated.

    Args:
        now: what the time is; another one than the machine's makes runs of any speed.
    """

    def __init__(self, now: Callable[[], Seconds] = now) -> None:
        self._now = now
        self._start = now()
        self._pauses = Seconds()
        self._earlier, self._earlier_pauses = Seconds(), Seconds()

    def go_on_from(self, elapsed: Seconds, pauses: Seconds) -> None:
        """Add what earlier tries have used, and what they have taken for evaluation."""
        self._earlier, self._earlier_pauses = elapsed, pauses

    def read(self) -> Seconds:
        """Work so far, earlier tries included."""
        return self._earlier + (self._now() - self._start - self._pauses)

    @property
    def pauses(self) -> Seconds:
        """All that was not work, earlier tries included."""
        return self._earlier_pauses + self._pauses

    @contextmanager
    def paused(self) -> Iterator[None]:
        """What happens inside costs no training time."""
        stopped = self._now()
        try:
            yield
        finally:
            self._pauses += self._now() - stopped


def snapshot_due(last_s: float, now_s: float, before_s: float) -> bool:
    """Whether a geometric time (1, 2, 4, 8, ... s) has passed since the last snapshot.

    Both on the whole training clock, where methods meet, and on the optimisation's own seconds,
    where most is learned.

    Args:
        last_s, now_s: seconds of the optimisation at the last snapshot and now.
        before_s: seconds of the training clock before the optimisation.
    """
    return any(_doublings(now_s + s) > _doublings(last_s + s) for s in (0.0, before_s))


def _doublings(seconds: float) -> int:
    return math.floor(math.log2(seconds)) if seconds >= 1.0 else -1
