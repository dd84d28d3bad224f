"""A range of a recording's frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int32]


@dataclass(frozen=True)
class ClipRange:
    """Source frames ``start`` to ``start + length - 1``."""

    start: int
    length: int

    @property
    def numbers(self) -> Indices:
        """(N,) all of them."""
        return np.arange(self.start, self.start + self.length, dtype=np.int32)

    def among(self, numbers: Indices) -> Indices:
        """Those of the numbers that lie in the range."""
        return numbers[(numbers >= self.start) & (numbers < self.start + self.length)]

    def __str__(self) -> str:
        return f"{self.start} to {self.start + self.length - 1}"
