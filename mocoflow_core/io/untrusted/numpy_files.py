"""NumPy's own files: ``.npy``, with objects too, and archives of them, ``.npz``.

Source: numpy, ``numpy/lib/_format_impl.py`` (the header is a Python literal; here it is matched,
not evaluated).
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from struct import Struct

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.array_records import native, plain_dtype, require_bytes, shaped
from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.records import integers
from mocoflow_core.io.untrusted.refusal import damaged
from mocoflow_core.io.untrusted.restricted_pickle import read_pickle_stream
from mocoflow_core.io.untrusted.zip_archive import open_zip

NPY_MAGIC = b"\x93NUMPY"

_LENGTHS = {1: Struct("<H"), 2: Struct("<I"), 3: Struct("<I")}
_LONGEST_HEADER = 10_000
_DESCR = re.compile(r"'descr':\s*'([^']{1,20})'")
_FORTRAN = re.compile(r"'fortran_order':\s*(True|False)")
_SHAPE = re.compile(r"'shape':\s*\(([\dL,\s]*)\)")


def read_npy_stream(stream: ByteStream, allowance: Allowance) -> object:
    """The array, or the plain structure of an array of objects.

    An array of objects comes back as nested lists, and one without axes, as ``np.save`` makes of a
    dict, as that object itself.

    Raises:
        InputError: a damaged header, a length that is not the declared one, a name not admitted.
    """
    code, fortran, shape = _header(stream)
    dtype = plain_dtype(code)
    if dtype is None:
        return read_pickle_stream(stream, allowance)
    require_bytes(shape, dtype.itemsize, stream.remaining)
    flat = np.empty(math.prod(shape), dtype)
    if flat.nbytes:
        stream.fill(memoryview(flat.view(np.uint8)))  # type: ignore[arg-type]
    return native(shaped(flat, shape, "F" if fortran else "C"))


def read_npz_file(path: Path, allowance: Allowance) -> dict[str, object]:
    """Every array of the archive by its name without ``.npy``, read as ``read_npy_stream`` does."""
    result: dict[str, object] = {}
    with open_zip(path, allowance) as archive:
        for name in archive.names:
            if not name.endswith(".npy"):
                raise InputError(
                    "it must hold arrays only",
                    f"an entry {name[:80]!r}",
                    "Save it with numpy.savez.",
                )
            stream = ByteStream.over(archive.read(name))
            result[name.removesuffix(".npy")] = read_npy_stream(stream, allowance)
    return result


def _header(stream: ByteStream) -> tuple[str, bool, tuple[int, ...]]:
    if stream.take(len(NPY_MAGIC)) != NPY_MAGIC:
        raise damaged("an .npy file that does not begin as one")
    major, _ = stream.take(2)
    length = _LENGTHS.get(major)
    if length is None:
        raise damaged(f"an .npy file of unknown version {major}")
    (size,) = length.unpack(stream.take(length.size))
    if size > _LONGEST_HEADER:
        raise damaged(f"an .npy header of {size:,} bytes")
    text = stream.take(size).decode("latin1")
    descr, fortran, shape = (form.search(text) for form in (_DESCR, _FORTRAN, _SHAPE))
    if descr is None or fortran is None or shape is None:
        raise InputError(
            "it must hold a plain array", "one with named fields, or no array", "Save plain arrays."
        )
    sizes = [int(size.strip().rstrip("L")) for size in shape[1].split(",") if size.strip()]
    return descr[1], fortran[1] == "True", integers(tuple(sizes), 16)
