"""Tensors of torch out of a pickle, as NumPy arrays; torch itself is not asked.

``torch.load`` can allocate what a damaged file declares before it looks whether the data is there;
here a tensor is a view into bytes that were counted first. Source: pytorch, ``torch/_utils.py``,
``torch/serialization.py`` (storages as persistent ids, tensors as views into them).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.records import Admitted, Machine, Record, integers, latin1_bytes
from mocoflow_core.io.untrusted.refusal import damaged
from mocoflow_core.io.untrusted.torch_storages import STORAGE_CLASSES, Storage, as_numbers
from mocoflow_core.io.untrusted.torch_stream import read_torch_stream


class TensorRecord(Record):
    """A view into a storage, which becomes an array of its own."""

    def __init__(
        self, storage: Storage, offset: int, size: tuple[int, ...], stride: tuple[int, ...]
    ) -> None:
        self._storage = storage
        self._offset, self._size, self._stride = offset, size, stride
        self._array: NDArray[np.generic] | None = None

    def build(self, state: object, machine: Machine) -> None:
        raise damaged("a tensor with a strange state")

    def plain(self, allowance: Allowance) -> object:
        if self._array is None:
            self._array = self._copied(allowance)
        return self._array

    def _copied(self, allowance: Allowance) -> NDArray[np.generic]:
        flat = self._storage.array()
        if math.prod(self._size) == 0:
            return as_numbers(np.empty(self._size, flat.dtype), self._storage.code)
        steps = zip(self._size, self._stride, strict=True)
        last = self._offset + sum((n - 1) * step for n, step in steps)
        if last >= len(flat):
            raise damaged(f"a tensor of size {self._size} beyond its storage of {len(flat)}")
        # A stride of zero repeats one number: the copies may be larger than the storage.
        allowance.spend_bytes(self._storage.own.beyond(math.prod(self._size) * flat.itemsize))
        strides = tuple(step * flat.itemsize for step in self._stride)
        view = np.lib.stride_tricks.as_strided(
            flat[self._offset :], self._size, strides, writeable=False
        )
        return as_numbers(view, self._storage.code)


def _rebuild_tensor(arguments: Sequence[object], machine: Machine) -> TensorRecord:
    """``torch._utils._rebuild_tensor_v2(storage, offset, size, stride, grad, hooks[, meta])``."""
    storage, offset, size, stride, _, hooks, *meta = arguments
    if not isinstance(storage, Storage) or hooks or any(meta):
        raise damaged("a tensor that is not made as torch makes it")
    sizes, strides = integers(size, 16), integers(stride, 16)
    if len(sizes) != len(strides):
        raise damaged("a tensor whose size and stride disagree")
    return TensorRecord(storage, integers((offset,), 1)[0], sizes, strides)


def _load_from_bytes(arguments: Sequence[object], machine: Machine) -> Storage:
    """``torch.storage._load_from_bytes(bytes)``: a whole torch file that holds one storage."""
    (data,) = arguments
    whole = bytes(latin1_bytes(data))
    # Its bytes and the tensor made of them, once more for each call.
    machine.allowance.spend_copy(2 * len(whole))
    value = read_torch_stream(ByteStream.over(whole), machine.nested)
    if not isinstance(value, Storage):
        raise damaged("a tensor without its data")
    return value


TORCH_NAMES: Mapping[str, Admitted] = {
    "torch._utils._rebuild_tensor_v2": Admitted("torch._rebuild_tensor_v2", _rebuild_tensor),
    "torch.storage._load_from_bytes": Admitted("torch._load_from_bytes", _load_from_bytes),
    **{kind.name: kind for kind in STORAGE_CLASSES},
}
