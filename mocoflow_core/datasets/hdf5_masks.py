"""Masks in one array of an HDF5 file, read frame by frame: a whole clip need not fit in memory."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.dataset_scene import Mask
from mocoflow_core.errors import InputError

# Frames that are read at once where compressed blocks span several of them.
_LARGEST_BLOCK = 64


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
        with self._open() as masks:
            count, height, width = masks.shape
            return count, height, width

    @property
    def indices(self) -> NDArray[np.int32]:
        return np.arange(self.shape[0], dtype=np.int32)

    @property
    def files(self) -> list[Path]:
        return [self.path]

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        """The wanted masks, ascending. Raises InputError where the file is damaged."""
        with self._open() as masks:
            size = min(masks.chunks[0] if masks.chunks else 1, _LARGEST_BLOCK)
            block: NDArray[np.generic] = np.empty((0, 0, 0))
            start = 0
            for number in sorted(wanted):
                if not start <= number < start + len(block):
                    start = number - number % size
                    block = self._block(masks, start, start + size)
                yield number, block[number - start] != 0

    def _block(self, masks: h5py.Dataset, start: int, stop: int) -> NDArray[np.generic]:
        try:
            return np.asarray(masks[start:stop])
        except OSError as error:
            raise InputError(
                f"{self.path.name} must hold masks that can be read",
                f"damaged data at frame {start}",
                "Copy the file again.",
            ) from error

    def _open(self) -> _OpenMasks:
        return _OpenMasks(self.path, self.name)


class _OpenMasks:
    """The array while its file is open."""

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name

    def __enter__(self) -> h5py.Dataset:
        try:
            self._file = h5py.File(self._path, "r")
        except OSError as error:
            raise self._refused("a file that is no HDF5, or a damaged one") from error
        try:
            return self._array()
        except BaseException:
            self._file.close()
            raise

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _array(self) -> h5py.Dataset:
        # A link may lead to another file, and so may the data themselves.
        if not isinstance(self._file.get(self._name, getlink=True), h5py.HardLink):
            raise self._refused(f"none, but {', '.join(list(self._file)[:5]) or 'nothing'}")
        array = self._file[self._name]
        if not isinstance(array, h5py.Dataset) or array.is_virtual or array.external:
            raise self._refused("one whose data lie elsewhere")
        if array.ndim != 3 or array.dtype.kind not in "biu":
            raise self._refused(f"{array.dtype} of shape {array.shape}")
        return array

    def _refused(self, found: str) -> InputError:
        return InputError(
            f"{self._path.name} must hold an array {self._name!r} of whole numbers "
            "(frames, height, width)",
            found,
            "Copy the file again from the data set.",
        )
