"""A machine whose speed the test decides."""

from __future__ import annotations

from mocoflow_core.training.clock import Seconds


class SlowClock:
    """Time that passes by being told so; ``per_look`` seconds also pass with each look at it."""

    def __init__(self, per_look: float = 0.0) -> None:
        self.wall = 1000.0
        self.per_look = per_look

    def spend(self, seconds: float) -> None:
        self.wall += seconds

    def __call__(self) -> Seconds:
        self.wall += self.per_look
        return Seconds(self.wall, 2.0 * self.wall)
