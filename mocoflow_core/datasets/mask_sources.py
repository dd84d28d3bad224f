"""Where the masks of a data set come from: an HDF5 file, image files, other masks made smaller."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.dataset_scene import Mask, MaskSource


@dataclass(frozen=True, eq=False)
class ErodedMasks:
    """Masks made smaller by a square of ``side_px`` (Neural Body: 4 for People-Snapshot)."""

    source: MaskSource
    side_px: int

    @property
    def indices(self) -> NDArray[np.int32]:
        return self.source.indices

    @property
    def files(self) -> list[Path]:
        return self.source.files

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        kernel = np.ones((self.side_px, self.side_px), np.uint8)
        for number, mask in self.source.read(wanted):
            yield number, cv2.erode(mask.astype(np.uint8), kernel) > 0


@dataclass(frozen=True, eq=False)
class ImageMasks:
    """Masks in image files by number; ``decode`` turns a file into a mask."""

    images: dict[int, Path]
    decode: Callable[[Path], Mask]

    @property
    def indices(self) -> NDArray[np.int32]:
        return np.array(sorted(self.images), np.int32)

    @property
    def files(self) -> list[Path]:
        return [self.images[number] for number in sorted(self.images)]

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        for number in sorted(wanted):
            yield number, self.decode(self.images[number])
