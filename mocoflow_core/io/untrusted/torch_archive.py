"""torch's archives: a ZIP file of one pickle and one entry per storage.

Source: pytorch, ``torch/serialization.py`` (_save), ``caffe2/serialize/inline_container.h``.
"""

from __future__ import annotations

from pathlib import Path

from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.plain_tree import plain_tree
from mocoflow_core.io.untrusted.refusal import damaged
from mocoflow_core.io.untrusted.restricted_pickle import PickleMachine
from mocoflow_core.io.untrusted.torch_storages import Storage, storage_of
from mocoflow_core.io.untrusted.torch_stream import big_endian, read_torch_stream, same_storage
from mocoflow_core.io.untrusted.zip_archive import ZipArchive, open_zip

PICKLE = "/data.pkl"


def read_torch_zip(path: Path, allowance: Allowance) -> object:
    """The plain structure in a torch archive, tensors as NumPy arrays."""
    with open_zip(path, allowance) as archive:
        return _content(archive, allowance)


def read_old_torch(stream: ByteStream, allowance: Allowance) -> object:
    """The same of a file in the format before torch 1.6."""
    nested = PickleMachine(stream, allowance).nested
    return plain_tree(read_torch_stream(stream, nested), allowance)


def _content(archive: ZipArchive, allowance: Allowance) -> object:
    pickles = [name for name in archive.names if name.endswith(PICKLE)]
    if len(pickles) != 1 or pickles[0].count("/") != 1:
        raise damaged("a torch archive that has not exactly one data.pkl")
    folder = pickles[0].removesuffix(PICKLE)
    order = f"{folder}/byteorder"
    if order in archive.names and archive.read(order) != b"little":
        raise big_endian()
    storages: dict[str, Storage] = {}

    def outside(identity: object) -> object:
        empty, key = storage_of(identity)
        storage = same_storage(storages, key, empty)
        if storage.data is None:
            storage.data = archive.read(f"{folder}/data/{key}")
        return storage

    stream = ByteStream.over(archive.read(pickles[0]))
    return plain_tree(PickleMachine(stream, allowance, outside).run(), allowance)
