"""torch's older file format: five pickles in a row, then the raw bytes of each storage.

Tensors within NumPy pickles still use it. Source: pytorch, ``torch/serialization.py``
(_legacy_save).
"""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.records import Outside
from mocoflow_core.io.untrusted.refusal import damaged
from mocoflow_core.io.untrusted.torch_storages import Storage, storage_of

MAGIC_NUMBER = 0x1950A86A20F9469CFC6C
_VERSION = 1001
_COUNT = Struct("<q")


def read_torch_stream(
    stream: ByteStream, nested: Callable[[ByteStream, Outside | None], object]
) -> object:
    """What such a file holds; its tensors are records until they are made plain."""
    if nested(stream, None) != MAGIC_NUMBER or nested(stream, None) != _VERSION:
        raise damaged("a torch file without its magic number")
    machine = nested(stream, None)
    if not isinstance(machine, dict) or machine.get("little_endian") is not True:
        raise big_endian()
    storages: dict[str, Storage] = {}

    def outside(identity: object) -> object:
        storage, key = storage_of(identity)
        return same_storage(storages, key, storage)

    value = nested(stream, outside)
    keys = nested(stream, None)
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise damaged("a torch file without a list of its tensors")
    if len(keys) != len(storages) or set(keys) != set(storages):
        raise damaged("a torch file whose tensors are not those it lists")
    for key in keys:
        _fill(storages[key], stream)
    return value


def same_storage(storages: dict[str, Storage], key: str, storage: Storage) -> Storage:
    """The storage known under this key, else the new one."""
    known = storages.setdefault(key, storage)
    if (known.code, known.count) != (storage.code, storage.count):
        raise damaged("tensors that disagree about their data")
    return known


def big_endian() -> InputError:
    return InputError(
        "it must have been written on a little-endian machine",
        "a torch file of another byte order",
        "Convert it on the machine that wrote it.",
    )


def _fill(storage: Storage, stream: ByteStream) -> None:
    (count,) = _COUNT.unpack(stream.take(_COUNT.size))
    if count != storage.count:
        raise damaged("a tensor whose data has another length")
    storage.data = stream.take(storage.nbytes)
