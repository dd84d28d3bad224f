"""Masks in one array of an HDF5 file, read frame by frame: a whole clip need not fit in memory."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.dataset_scene import Mask
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import hdf5_rows, hdf5_shapes


@dataclass(frozen=True)
class Hdf5Masks:
    """An array (N, H, W) of whole numbers; any but zero is the person.

    Compared as they are: in ``int8``, as People-Snapshot has it, 255 would overflow.
    """

    path: Path
    name: str = "masks"

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """Number, height, width. Raises InputError where the file does not hold such an array."""
        arrays = hdf5_shapes(self.path)
        found = arrays.get(self.name)
        if found is None or len(found.shape) != 3 or found.dtype.kind not in "biu":
            there = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            raise InputError(
                f"{self.path.name} must hold an array {self.name!r} of whole numbers "
                "(frames, height, width)",
                there or "nothing",
                "Copy the file again from the data set.",
            )
        count, height, width = found.shape
        return count, height, width

    @property
    def indices(self) -> NDArray[np.int32]:
        return np.arange(self.shape[0], dtype=np.int32)

    @property
    def files(self) -> list[Path]:
        return [self.path]

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        """The wanted masks, ascending. Raises InputError where the file is damaged."""
        numbers = sorted(wanted)
        for number, values in zip(numbers, hdf5_rows(self.path, self.name, numbers), strict=True):
            yield number, values != 0
