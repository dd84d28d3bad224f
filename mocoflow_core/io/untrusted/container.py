"""Which kind of file lies there, told by its first bytes, and what it holds."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import hdf5_file, numpy_files, torch_archive
from mocoflow_core.io.untrusted.byte_stream import ByteStream, opened
from mocoflow_core.io.untrusted.compression import LONGEST_MAGIC, is_compressed, unpacked
from mocoflow_core.io.untrusted.hdf5_file import ArrayShape
from mocoflow_core.io.untrusted.limits import Allowance, Limits
from mocoflow_core.io.untrusted.refusal import naming, require_file
from mocoflow_core.io.untrusted.restricted_pickle import read_pickle_stream

_ZIP_MAGIC = b"PK\x03\x04"
_OLD_TORCH_MAGIC = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."
_LONGEST_START = max(LONGEST_MAGIC, len(_OLD_TORCH_MAGIC))

DEFAULT_LIMITS = Limits()


def read_untrusted(path: Path, limits: Limits = DEFAULT_LIMITS) -> object:
    """What a data file of a stranger holds, whichever of the known containers it is.

    Nothing in the file can run: names are compared with a table, never imported. The container is
    found from the first bytes, not from the file's name.

    Returns:
        A plain structure of dict, list, tuple, str, bytes, int, float, complex, bool, None and
        NumPy arrays of numbers or text. OrderedDict and defaultdict come back as dict, sets and
        arrays of objects as list (an array of objects without axes as the object itself), NumPy
        scalars as Python numbers, torch tensors, sparse matrices and chumpy arrays as arrays,
        text of Python 2 as str decoded from latin1. Arrays keep their type, in native byte order.

    Raises:
        InputError: no such file, not one of the containers, damaged, beyond the limits, or it asks
            for anything but data.
    """
    require_file(path)
    with naming(path):
        start = _start(path)
        allowance = _allowance(path, limits)
        if start.startswith(hdf5_file.MAGIC):
            return hdf5_file.read_datasets(path, allowance)
        if start.startswith(_ZIP_MAGIC):
            return _read_zip(path, allowance)
        with opened(path) as stream:
            return _read_stream(stream, start, allowance)


def read_pickle(path: Path, limits: Limits = DEFAULT_LIMITS) -> object:
    """A pickle of any protocol, Python 2's too; returns and raises as ``read_untrusted`` does."""
    require_file(path)
    with naming(path), opened(path) as stream:
        return read_pickle_stream(stream, _allowance(path, limits))


def read_joblib(path: Path, limits: Limits = DEFAULT_LIMITS) -> object:
    """A joblib file, compressed or not; returns and raises as ``read_untrusted`` does."""
    require_file(path)
    with naming(path), opened(path) as stream:
        start, allowance = _start(path), _allowance(path, limits)
        if is_compressed(start):
            stream = unpacked(stream, start, allowance)
        return read_pickle_stream(stream, allowance)


def read_npy(path: Path, limits: Limits = DEFAULT_LIMITS) -> object:
    """An ``.npy`` file, with objects too; returns and raises as ``read_untrusted`` does."""
    require_file(path)
    with naming(path), opened(path) as stream:
        return numpy_files.read_npy_stream(stream, _allowance(path, limits))


def read_npz(path: Path, limits: Limits = DEFAULT_LIMITS) -> dict[str, object]:
    """An ``.npz`` archive; returns and raises as ``read_untrusted`` does."""
    require_file(path)
    with naming(path):
        return numpy_files.read_npz_file(path, _allowance(path, limits))


def read_torch(path: Path, limits: Limits = DEFAULT_LIMITS) -> object:
    """A file of ``torch.save``, new or old; returns and raises as ``read_untrusted`` does."""
    require_file(path)
    with naming(path):
        if _start(path).startswith(_ZIP_MAGIC):
            return torch_archive.read_torch_zip(path, _allowance(path, limits))
        with opened(path) as stream:
            return torch_archive.read_old_torch(stream, _allowance(path, limits))


def read_hdf5(path: Path, limits: Limits = DEFAULT_LIMITS) -> dict[str, NDArray[np.generic]]:
    """Every data set of an HDF5 file by its full name, such as ``pose`` or ``group/pose``.

    Raises:
        InputError: as ``read_untrusted``; also links that are not plain, data in other files, and
            anything but numbers and text of fixed length.
    """
    require_file(path)
    with naming(path):
        return hdf5_file.read_datasets(path, _allowance(path, limits))


def hdf5_shapes(path: Path, limits: Limits = DEFAULT_LIMITS) -> dict[str, ArrayShape]:
    """Shape and type of every data set, without its content; raises as ``read_hdf5`` does."""
    require_file(path)
    with naming(path):
        return hdf5_file.read_shapes(path, _allowance(path, limits))


def hdf5_rows(
    path: Path, name: str, rows: Sequence[int], limits: Limits = DEFAULT_LIMITS
) -> Iterator[NDArray[np.generic]]:
    """The given rows of the data set ``name``, in that order, one in memory at a time.

    Raises:
        InputError: as ``read_hdf5``; also where there is no such data set or row.
    """
    require_file(path)
    with naming(path):
        yield from hdf5_file.read_rows(path, name, rows, _allowance(path, limits))


def _allowance(path: Path, limits: Limits) -> Allowance:
    return Allowance(limits, path.stat().st_size)


def _start(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_LONGEST_START)


def _read_zip(path: Path, allowance: Allowance) -> object:
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    is_torch = any(name.endswith(torch_archive.PICKLE) for name in names)
    read: Callable[[Path, Allowance], object] = (
        torch_archive.read_torch_zip if is_torch else numpy_files.read_npz_file
    )
    return read(path, allowance)


def _read_stream(stream: ByteStream, start: bytes, allowance: Allowance) -> object:
    if start.startswith(numpy_files.NPY_MAGIC):
        return numpy_files.read_npy_stream(stream, allowance)
    if start.startswith(_OLD_TORCH_MAGIC):
        return torch_archive.read_old_torch(stream, allowance)
    if is_compressed(start):
        return read_pickle_stream(unpacked(stream, start, allowance), allowance)
    if start[:1] in _PICKLE_STARTS:
        return read_pickle_stream(stream, allowance)
    raise InputError(
        "it must be a pickle, joblib, NumPy, torch or HDF5 file",
        f"one that begins with {start[:8]!r}",
        "Check that this is the file the tool wrote.",
    )


# PROTO, or, in protocols 0 and 1, the instruction that begins a container or a global name.
_PICKLE_STARTS = (b"\x80", b"(", b"]", b"}", b"c")
