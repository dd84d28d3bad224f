"""Some frames of a source, and frames with something done to them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_source import FrameSource, Image
from mocoflow_core.datasets.dataset_scene import MaskSource

WHITE = 255


@dataclass(frozen=True, eq=False)
class ChosenFrames:
    """Only some of the frames of a source, under their own numbers."""

    source: FrameSource
    indices: NDArray[np.int32]  # (N,) ascending

    @property
    def files(self) -> list[Path]:
        return self.source.files

    @property
    def fps(self) -> float | None:
        return self.source.fps

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        return self.source.read(wanted)


@dataclass(frozen=True, eq=False)
class FramesOnWhite:
    """Frames whose pixels outside the masks are white (MoCo-Flow sec. 4, People-Snapshot)."""

    source: FrameSource
    masks: MaskSource

    @property
    def indices(self) -> NDArray[np.int32]:
        return np.intersect1d(self.source.indices, self.masks.indices)

    @property
    def files(self) -> list[Path]:
        return [*self.source.files, *self.masks.files]

    @property
    def fps(self) -> float | None:
        return self.source.fps

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        both = zip(self.source.read(wanted), self.masks.read(wanted), strict=True)
        for (number, image), (_, mask) in both:
            yield number, np.where(mask[..., None], image, np.uint8(WHITE))
