"""The clip that a finished run has seen: its frames, and when they are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_selection import select_frames
from mocoflow_core.errors import InputError
from mocoflow_core.io.run_folder import RunRecord


@dataclass(frozen=True, eq=False)
class RunClip:
    """Source numbers and rates; ``up`` is the world's direction."""

    first_frame: int
    last_frame: int
    source_fps: float
    fps: float  # at which frames were selected
    up: NDArray[np.float64]  # (3,) unit

    @classmethod
    def of(cls, run: RunRecord) -> RunClip:
        named: dict[str, Any] = run.capture
        return cls(
            int(named["first_frame"]),
            int(named["last_frame"]),
            float(named["source_fps"]),
            float(named["fps"]),
            np.asarray(named["up"], np.float64),
        )

    @property
    def duration_s(self) -> float:
        return (self.last_frame - self.first_frame) / self.source_fps

    def time(self, frame: float) -> float:
        """Normalised time of a source number."""
        return (frame - self.first_frame) / max(self.last_frame - self.first_frame, 1)

    def time_of_second(self, second: float) -> float:
        """Normalised time of seconds since the first frame."""
        return second / max(self.duration_s, 1e-9)

    def working_frames(self) -> tuple[int, ...]:
        """Frames as they were selected for training, those that repeat another among them."""
        filmed = np.arange(self.first_frame, self.last_frame + 1, dtype=np.int32)
        none = np.empty(0, np.int32)
        selection = select_frames(filmed, self.source_fps, self.fps, none, 0, 0)
        return tuple(int(frame) for frame in selection.working)

    def require_inside(self, times: Iterable[float]) -> None:
        """Raise InputError where a normalised time lies outside the clip."""
        outside = [time for time in times if not -1e-9 <= time <= 1.0 + 1e-9]
        if outside:
            first, last = self.first_frame, self.last_frame
            raise InputError(
                f"Times must lie in the clip: frames {first} to {last}, 0 to {self.duration_s:g} s",
                f"{first + outside[0] * (last - first):g} as a frame",
                "Choose times inside.",
            )
