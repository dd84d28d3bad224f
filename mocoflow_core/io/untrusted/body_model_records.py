"""The two foreign kinds of object in files of body models: chumpy's arrays and sparse matrices.

Neither package is imported. chumpy fails to import with current NumPy anyway.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.array_records import ArrayRecord
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.records import Machine, Record, integers
from mocoflow_core.io.untrusted.refusal import damaged

_ENTRY_BYTES = 16  # row and column while an entry finds its place


class StateRecord(Record):
    """Any ``chumpy`` object: the array under ``x`` where it has one, else all that it holds."""

    def __init__(self) -> None:
        self._state: dict[object, object] | None = None

    def build(self, state: object, machine: Machine) -> None:
        if not isinstance(state, dict) or self._state is not None:
            raise damaged("an object with a strange state")
        self._state = state

    def plain(self, allowance: Allowance) -> object:
        state = self._state or {}
        return state.get("x", state)


class SparseColumnsRecord(Record):
    """A ``scipy.sparse`` matrix by columns, which becomes a dense array (R, C)."""

    def __init__(self) -> None:
        self._state: dict[object, object] = {}
        self._dense: NDArray[np.generic] | None = None

    def build(self, state: object, machine: Machine) -> None:
        if not isinstance(state, dict) or self._state:
            raise damaged("a sparse matrix with a strange state")
        self._state = state

    def plain(self, allowance: Allowance) -> object:
        if self._dense is None:
            self._dense = self._filled(allowance)
        return self._dense

    def _filled(self, allowance: Allowance) -> NDArray[np.generic]:
        shape = integers(self._state.get("_shape", self._state.get("shape")), 2)
        if len(shape) != 2:
            raise damaged("a sparse matrix without a shape")
        data, indices, pointers = (
            self._vector(name, allowance) for name in ("data", "indices", "indptr")
        )
        whole = indices.dtype.kind in "iu" and pointers.dtype.kind in "iu"
        if data.dtype.kind not in "fiub" or not whole:
            raise damaged("a sparse matrix that is not made of numbers")
        starts: NDArray[np.int64] = pointers.astype(np.int64)
        if len(starts) != shape[1] + 1 or len(data) != len(indices):
            raise damaged("a sparse matrix whose parts disagree")
        if len(indices) and not 0 <= indices.min() <= indices.max() < shape[0]:
            raise damaged("a sparse matrix with an entry outside")
        # Compared, not subtracted: differences of such numbers can wrap round to harmless ones.
        if starts[0] != 0 or starts[-1] != len(data) or (starts[1:] < starts[:-1]).any():
            raise damaged("a sparse matrix whose columns are out of order")
        allowance.spend_bytes(shape[0] * shape[1] * data.dtype.itemsize + _ENTRY_BYTES * len(data))
        dense = np.zeros(shape, data.dtype)
        columns = np.repeat(np.arange(shape[1]), np.diff(starts))
        np.add.at(dense, (indices, columns), data)  # type: ignore[arg-type]
        return dense

    def _vector(self, name: str, allowance: Allowance) -> NDArray[np.generic]:
        value = self._state.get(name)
        if isinstance(value, ArrayRecord):
            value = value.plain(allowance)
        if not isinstance(value, np.ndarray) or value.ndim != 1:
            raise InputError(
                "its sparse matrix must be by columns",
                f"one without {name}",
                "Save it with scipy.sparse as csc_matrix, or as a plain array.",
            )
        return value
