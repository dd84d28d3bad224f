"""Some of the frames or masks of a source."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Picture = TypeVar("Picture", covariant=True)


class PictureSource(Protocol[Picture]):
    """Frames or masks by source number."""

    @property
    def files(self) -> list[Path]:
        """The files that hold them."""

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Picture]]:
        """The wanted ones one at a time, ascending."""


@dataclass(frozen=True, eq=False)
class Chosen(Generic[Picture]):
    """Only some of the frames or masks of a source, under their own numbers."""

    source: PictureSource[Picture]
    indices: NDArray[np.int32]  # (N,) ascending
    fps: float | None = None

    @property
    def files(self) -> list[Path]:
        return self.source.files

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Picture]]:
        return self.source.read(wanted)
