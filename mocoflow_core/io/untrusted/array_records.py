"""NumPy arrays, types and scalars out of a pickle, put together by us.

NumPy's own ``__setstate__`` trusts its caller; here each part is checked before NumPy sees it.
Source: numpy, ``numpy/_core/src/multiarray/methods.c`` and ``descriptor.c`` (pickle states).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.records import Admitted, Machine, Record, integers, latin1_bytes
from mocoflow_core.io.untrusted.refusal import damaged

NDARRAY = Admitted("numpy.ndarray")

_NUMBER = re.compile(r"[<>=|]?(b1|[iu][1248]|f[248]|c8|c16|[SU][1-9]\d{0,7})")
_OBJECT = re.compile(r"[<>=|]?O[48]?")
_BYTE_ORDERS = ("<", ">", "=", "|")


def plain_dtype(code: object) -> np.dtype | None:
    """The type of a code such as ``<f4``; None for objects.

    Raises:
        InputError: anything but booleans, numbers, text and objects: no fields, no times.
    """
    text = code.decode("latin1") if isinstance(code, bytes) else code
    if isinstance(text, str) and _OBJECT.fullmatch(text):
        return None
    if isinstance(text, str) and _NUMBER.fullmatch(text):
        return np.dtype(text)
    found = repr(text[:80]) if isinstance(text, str) else type(text).__name__
    raise InputError(
        "its arrays must hold booleans, numbers or text",
        f"an array of type {found}",
        "Save plain arrays.",
    )


def require_bytes(shape: tuple[int, ...], itemsize: int, available: int) -> int:
    """The size of an array in bytes; InputError unless exactly that much is ``available``."""
    # An axis of length zero must not hide an absurd one beside it.
    if math.prod(max(n, 1) for n in shape) * max(itemsize, 1) >= 2**62:
        raise damaged(f"an array of shape {shape}")
    needed = math.prod(shape) * itemsize
    if needed != available:
        raise damaged(f"{available:,} bytes for an array of shape {shape}, {needed:,} bytes")
    return needed


class DtypeRecord(Record):
    """``numpy.dtype``: a code, and later a byte order."""

    def __init__(self, code: object) -> None:
        self.dtype = plain_dtype(code)

    @property
    def numeric(self) -> np.dtype:
        if self.dtype is None:
            raise InputError(
                "its arrays must hold booleans, numbers or text here",
                "an array of Python objects",
                "Save lists and dicts as they are, and numbers as plain arrays.",
            )
        return self.dtype

    def build(self, state: object, machine: Machine) -> None:
        if not isinstance(state, tuple) or not 5 <= len(state) <= 9:
            raise damaged("a type with a strange state")
        order, subarray, names, fields = state[1:5]
        order = order.decode("latin1") if isinstance(order, bytes) else order
        if subarray is not None or names is not None or fields is not None:
            raise InputError(
                "its arrays must be plain", "an array with named fields", "Save plain arrays."
            )
        if order not in _BYTE_ORDERS:
            raise damaged("a type with a strange byte order")
        if self.dtype is not None and order != "|":
            self.dtype = np.dtype(order + self.dtype.str[1:])

    def plain(self, allowance: Allowance) -> object:
        raise InputError("it must hold data", "a type in place of data", "Save plain arrays.")


class ArrayRecord(Record):
    """``numpy.ndarray``: empty at first, then a shape, a type and raw bytes or a list of objects.

    An array of objects becomes nested lists, one of no dimension the object itself.
    """

    def __init__(self) -> None:
        self.value: object = None
        self._built = False

    def build(self, state: object, machine: Machine) -> None:
        if not isinstance(state, tuple) or len(state) != 5 or self._built:
            raise damaged("an array with a strange state")
        _, shape, dtype, fortran, content = state
        if not isinstance(dtype, DtypeRecord):
            raise damaged("an array without a type")
        order = "F" if fortran else "C"
        if dtype.dtype is None:
            self.value = nested(content, integers(shape, 16), machine.allowance)
        else:
            data = latin1_bytes(content)
            self.value = array_of(data, dtype.dtype, shape, order, machine.allowance)
        self._built = True

    def plain(self, allowance: Allowance) -> object:
        if not self._built:
            raise damaged("an array without content")
        return self.value


def array_of(
    data: bytes | bytearray, dtype: np.dtype, shape: object, order: str, allowance: Allowance
) -> NDArray[np.generic]:
    """A new array with the given raw bytes, which may be the content of many others too."""
    sizes = integers(shape, 16)
    allowance.spend_copy(require_bytes(sizes, dtype.itemsize, len(data)))
    # A copy: writable, aligned, and free of the file's buffer.
    array = np.empty(math.prod(sizes), dtype)
    if array.nbytes:
        array.view(np.uint8)[:] = np.frombuffer(data, np.uint8)
    return native(shaped(array, sizes, order))


def native(array: NDArray[np.generic]) -> NDArray[np.generic]:
    """The same numbers in this machine's byte order, which other libraries insist on."""
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def shaped(array: NDArray[np.generic], shape: tuple[int, ...], order: str) -> NDArray[np.generic]:
    """Flat data with its axes, in the order of C or of Fortran (``F``)."""
    if order == "F":
        return array.reshape(shape[::-1]).T
    return array.reshape(shape)


def nested(content: object, shape: tuple[int, ...], allowance: Allowance) -> object:
    """The items of an object array as nested lists, or the one item of an array without axes.

    NumPy writes them in the order of C, whatever the order of the array.
    """
    if not isinstance(content, list) or len(content) != math.prod(shape):
        raise damaged("an array of objects with a strange number of them")
    if not shape:
        return content[0]
    allowance.spend_step(len(content))
    return _picked(content, np.arange(len(content)).reshape(shape), allowance)


def _picked(
    content: list[object], positions: NDArray[np.generic], allowance: Allowance
) -> list[object]:
    # An axis of length zero makes lists without end out of nothing: each of them is counted.
    allowance.spend_step()
    if positions.ndim == 1:
        return [content[int(p)] for p in positions]
    return [_picked(content, row, allowance) for row in positions]


def reconstruct(arguments: Sequence[object], machine: Machine) -> ArrayRecord:
    """``numpy.core.multiarray._reconstruct(numpy.ndarray, (0,), 'b')``, and in no other way."""
    subtype, shape, code = arguments
    if subtype is not NDARRAY or shape != (0,) or code not in ("b", b"b"):
        raise damaged("an array that is not made as NumPy makes it")
    return ArrayRecord()


def dtype(arguments: Sequence[object], machine: Machine) -> DtypeRecord:
    """``numpy.dtype(code, False, True)``."""
    if not 1 <= len(arguments) <= 3:
        raise damaged("a type that is not made as NumPy makes it")
    return DtypeRecord(arguments[0])


def scalar(arguments: Sequence[object], machine: Machine) -> object:
    """``numpy.core.multiarray.scalar(dtype, bytes)`` as a Python number or text."""
    kind, data = arguments
    if not isinstance(kind, DtypeRecord):
        raise damaged("a number without a type")
    raw = latin1_bytes(data)
    machine.allowance.spend_copy(len(raw))
    return array_of(raw, kind.numeric, (), "C", machine.allowance).item()


def from_buffer(arguments: Sequence[object], machine: Machine) -> NDArray[np.generic]:
    """``numpy.core.numeric._frombuffer(bytes, dtype, shape, order[, axes])``."""
    data, kind, shape, order, *axes = arguments
    if not isinstance(kind, DtypeRecord) or order not in ("C", "F", "K") or len(axes) > 1:
        raise damaged("an array that is not made as NumPy makes it")
    array = array_of(latin1_bytes(data), kind.numeric, shape, order, machine.allowance)
    if order == "K" and axes and axes[0] is not None:
        return array.transpose(integers(axes[0], 16))
    return array
