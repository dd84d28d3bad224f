"""Seconds of work on one artifact, summed over tries that were killed."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path


class WorkClock:
    """Wall and CPU seconds since its creation, plus those that earlier tries wrote down."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._earlier_wall_s, self._earlier_cpu_s = _read(path)
        self._wall_start = time.perf_counter()
        self._cpu_start = _cpu_seconds()
        self._aside_wall_s, self._aside_cpu_s = 0.0, 0.0

    @classmethod
    def of(cls, partial: Path) -> WorkClock:
        """The clock of a workspace; its notes lie beside the folder, not among the payloads."""
        return cls(partial.with_suffix(".seconds"))

    @property
    def wall_s(self) -> float:
        worked = time.perf_counter() - self._wall_start - self._aside_wall_s
        return self._earlier_wall_s + max(worked, 0.0)  # A clock may be put back.

    @property
    def cpu_s(self) -> float:
        worked = _cpu_seconds() - self._cpu_start - self._aside_cpu_s
        return self._earlier_cpu_s + max(worked, 0.0)

    def leave_out(self, wall_s: float, cpu_s: float) -> None:
        """Take off what did not go into the artifact, such as looking how good it is by now."""
        self._aside_wall_s += wall_s
        self._aside_cpu_s += cpu_s

    def note(self) -> None:
        """Write the sum down, by one rename."""
        beside = self._path.with_suffix(".seconds-new")
        beside.write_text(json.dumps([self.wall_s, self.cpu_s]))
        beside.replace(self._path)

    def forget(self) -> None:
        self._path.unlink(missing_ok=True)


def _read(path: Path) -> tuple[float, float]:
    """What was noted; nothing where the note was lost with the machine's power."""
    try:
        wall_s, cpu_s = json.loads(path.read_text())
    except (FileNotFoundError, ValueError, TypeError):
        return 0.0, 0.0
    return float(wall_s), float(cpu_s)


def _cpu_seconds() -> float:
    """CPU time of this process and of the children it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
