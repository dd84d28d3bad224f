"""joblib's arrays: a wrapper in the pickle, and right behind it the raw bytes.

A joblib file is therefore no plain pickle, and no standard unpickler gets through it. Arrays of
objects would hold a pickle of their own; they are refused.
Source: joblib, ``joblib/numpy_pickle.py`` (NumpyArrayWrapper.read_array).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.io.untrusted.array_records import (
    NDARRAY,
    DtypeRecord,
    native,
    require_bytes,
    shaped,
)
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.records import Machine, Record, integers
from mocoflow_core.io.untrusted.refusal import damaged

WRAPPER = "joblib.numpy_pickle.NumpyArrayWrapper"


class WrapperRecord(Record):
    """The wrapper; building it consumes the array's bytes from the stream."""

    def __init__(self) -> None:
        self._array: NDArray[np.generic] | None = None

    def build(self, state: object, machine: Machine) -> None:
        if not isinstance(state, dict) or self._array is not None:
            raise damaged("an array with a strange state")
        kind = state.get("dtype")
        if state.get("subclass") is not NDARRAY or not isinstance(kind, DtypeRecord):
            raise damaged("an array of a strange class or without a type")
        stream = machine.stream
        dtype, shape = kind.numeric, integers(state.get("shape"), 16)
        # Since joblib 1.2 the data is aligned: a byte says how many fill bytes follow.
        if state.get("numpy_array_alignment_bytes") is not None:
            stream.take(stream.take(1)[0])
        size = require_bytes(shape, dtype.itemsize, math.prod(shape) * dtype.itemsize)
        stream.require(size)
        flat = np.empty(math.prod(shape), dtype)
        if flat.nbytes:
            stream.fill(memoryview(flat.view(np.uint8)))  # type: ignore[arg-type]
        self._array = native(shaped(flat, shape, "F" if state.get("order") == "F" else "C"))

    def plain(self, allowance: Allowance) -> object:
        if self._array is None:
            raise damaged("an array without content")
        return self._array
