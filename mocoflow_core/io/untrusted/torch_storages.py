"""Blocks of numbers that torch's tensors look into."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.io.untrusted.limits import Allowance, OwnBytes
from mocoflow_core.io.untrusted.records import Admitted, Machine, Record, integers
from mocoflow_core.io.untrusted.refusal import damaged

# NumPy has no bfloat16: its two bytes are the upper half of a float32.
_BFLOAT16 = "bfloat16"
_STORAGE_TYPES = {
    "DoubleStorage": "<f8",
    "FloatStorage": "<f4",
    "HalfStorage": "<f2",
    "BFloat16Storage": _BFLOAT16,
    "LongStorage": "<i8",
    "IntStorage": "<i4",
    "ShortStorage": "<i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "?",
    "ComplexFloatStorage": "<c8",
    "ComplexDoubleStorage": "<c16",
}
STORAGE_CLASSES = {Admitted(f"torch.{name}"): code for name, code in _STORAGE_TYPES.items()}


@dataclass(eq=False)
class Storage(Record):
    """One block of memory that tensors look into; its bytes may come later in the file."""

    code: str
    count: int
    data: bytes | None = None
    own: OwnBytes = field(init=False)

    def __post_init__(self) -> None:
        self.own = OwnBytes(self.nbytes)

    @property
    def stored(self) -> np.dtype:
        return np.dtype("<u2" if self.code == _BFLOAT16 else self.code)

    @property
    def nbytes(self) -> int:
        return self.count * self.stored.itemsize

    def array(self) -> NDArray[np.generic]:
        if self.data is None or len(self.data) != self.nbytes:
            raise damaged(f"a tensor without its {self.nbytes:,} bytes")
        return np.frombuffer(self.data, self.stored)

    def build(self, state: object, machine: Machine) -> None:
        raise damaged("a tensor with a strange state")

    def plain(self, allowance: Allowance) -> object:
        return as_numbers(self.array(), self.code)


def as_numbers(array: NDArray[np.generic], code: str) -> NDArray[np.generic]:
    """A copy in a type that NumPy has."""
    if code == _BFLOAT16:
        return (array.astype(np.uint32) << 16).view(np.float32)
    return array.copy()


def storage_of(identity: object) -> tuple[Storage, str]:
    """An empty storage and its key, out of ``('storage', class, key, device, count, ...)``."""
    if not isinstance(identity, tuple) or not 5 <= len(identity) <= 6 or identity[0] != "storage":
        raise damaged("a strange reference to data outside the pickle")
    kind, key, count = identity[1], identity[2], identity[4]
    if not isinstance(kind, Admitted) or kind not in STORAGE_CLASSES:
        raise damaged("a tensor of a strange type")
    (count,) = integers((count,), 1)
    if not isinstance(key, str) or len(key) > 100 or (len(identity) == 6 and identity[5]):
        raise damaged("a tensor with a strange key")
    return Storage(STORAGE_CLASSES[kind], count), key
