"""The training clock: wall and CPU seconds of work that makes the result better."""

from __future__ import annotations

import time
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
    """Runs on from what earlier stages and earlier tries have used; stops while evaluating."""

    def __init__(self, before: Seconds) -> None:
        self._before = before
        self._start = now()

    def read(self) -> Seconds:
        return self._before + (now() - self._start)


def snapshot_due(taken: int, wall_s: float, earlier_s: float) -> bool:
    """Whether the next geometric time (1, 2, 4, 8, ... s after ``earlier_s``) has passed.

    Args:
        taken: snapshots taken so far.
        wall_s: training clock now.
        earlier_s: training clock when the optimisation started.
    """
    return wall_s - earlier_s >= 2.0**taken
