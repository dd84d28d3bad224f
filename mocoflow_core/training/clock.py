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

    def since(self, earlier: Seconds) -> Seconds:
        """What has passed in between; nothing by a clock that was put back."""
        return Seconds(max(self.wall - earlier.wall, 0.0), max(self.cpu - earlier.cpu, 0.0))


def now() -> Seconds:
    return Seconds(time.perf_counter(), time.process_time())


def unheard(wall_s: float, cpu_s: float) -> None:
    """Nobody else keeps a clock that has to leave pauses out."""


class TrainingClock:
    """Runs from its creation on; stops while the scene is evaluated; never goes back.

    Args:
        paused: is told the wall and CPU seconds of each pause, when it ends.
        now: what the time is; another one than the machine's makes runs of any speed.
    """

    def __init__(
        self,
        paused: Callable[[float, float], None] = unheard,
        now: Callable[[], Seconds] = now,
    ) -> None:
        self._tell = paused
        self._now = now
        self._looked = now()
        self._elapsed = Seconds()

    def go_on_from(self, elapsed: Seconds) -> None:
        """Add what earlier tries have used."""
        self._elapsed += elapsed

    def read(self) -> Seconds:
        """Work so far, earlier tries included."""
        before, self._looked = self._looked, self._now()
        self._elapsed += self._looked.since(before)
        return self._elapsed

    @contextmanager
    def paused(self) -> Iterator[None]:
        """What happens inside costs no training time."""
        self.read()
        stopped = self._looked
        try:
            yield
        finally:
            self._looked = self._now()
            pause = self._looked.since(stopped)
            self._tell(pause.wall, pause.cpu)


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
