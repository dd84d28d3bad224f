"""Reads an HDF5 file in a process of its own and writes its numbers to standard output.

A program, not a module: it is run by its path and imports nothing of this project. The request
comes as one line of JSON on standard input, ``{"path", "name", "rows", "bytes", "seconds",
"members"}``; ``name`` null asks for everything, ``rows`` null for whole data sets, ``bytes`` 0 for
no content. Each data set is one line of JSON, ``{"name", "dtype", "shape"}``, and its raw bytes;
what must not be read is one line ``{"refused": [required, got, action]}``.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Iterator
from typing import Any, BinaryIO

import h5py
import numpy as np

OVERHEAD_BYTES = 2**31  # the interpreter and its libraries
SMALLEST_CHUNK_BYTES = 2**26
# Chunks span many frames of a video: those of a row of frames are kept, not unpacked for each.
CACHE_BYTES, CACHE_SLOTS = 2**27, 10_007
SLAB_BYTES = 2**26
NUMBERS_AND_TEXT = "biufS"
KNOWN_FILTERS = {1: "gzip", 2: "shuffle", 3: "fletcher32", 4: "szip", 6: "scale", 32000: "lzf"}


class RefusedError(Exception):
    """Something that a data set's file has no need of."""


def main(source: BinaryIO, target: BinaryIO) -> None:
    """Answer the one request that comes from ``source``."""
    request = json.loads(source.readline())
    _bound(request)
    try:
        with h5py.File(
            request["path"], "r", locking=False, rdcc_nbytes=CACHE_BYTES, rdcc_nslots=CACHE_SLOTS
        ) as file:
            found = dict(_datasets(file, request["members"]))
            if request["name"] is not None and request["name"] not in found:
                there = ", ".join(sorted(found)[:20]) or "nothing"
                raise RefusedError(
                    f"it must hold {request['name']!r}", there, "Check that this is the right file."
                )
            for name, dataset in found.items():
                if request["name"] in (None, name):
                    _write(target, name, dataset, request)
    except RefusedError as refused:
        _line(target, {"refused": list(refused.args)})
    target.flush()


def _bound(request: dict[str, Any]) -> None:
    bounds = {
        resource.RLIMIT_AS: request["bytes"] + OVERHEAD_BYTES,
        resource.RLIMIT_CPU: request["seconds"],
        resource.RLIMIT_FSIZE: 0,
        resource.RLIMIT_CORE: 0,
    }
    for kind, bound in bounds.items():
        outer = resource.getrlimit(kind)[1]
        lower = bound if outer == resource.RLIM_INFINITY else min(bound, outer)
        resource.setrlimit(kind, (lower, lower))


def _datasets(file: h5py.File, members: int) -> Iterator[tuple[str, h5py.Dataset]]:
    """Every data set once, along plain links only; a group met twice is not entered again."""
    waiting: list[tuple[str, h5py.Group]] = [("", file)]
    seen: set[h5py.h5g.GroupID | h5py.h5d.DatasetID] = set()
    while waiting:
        prefix, group = waiting.pop()
        for name in sorted(group):
            if group.id.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
                raise RefusedError(
                    "it must hold its data itself",
                    f"a link to elsewhere under {prefix + name!r}",
                    "Copy the data into the file.",
                )
            item = group[name]
            if item.id in seen or len(seen) >= members:
                raise RefusedError(
                    f"it must hold each of at most {members:,} members once",
                    f"another one under {prefix + name!r}",
                    "Get the file from its maker again.",
                )
            seen.add(item.id)
            if isinstance(item, h5py.Group):
                waiting.append((f"{prefix}{name}/", item))
            elif isinstance(item, h5py.Dataset):
                yield prefix + name, item


def _require_plain(name: str, dataset: h5py.Dataset) -> None:
    creation = dataset.id.get_create_plist()
    filters = [creation.get_filter(i)[0] for i in range(creation.get_nfilters())]
    unknown = [number for number in filters if number not in KNOWN_FILTERS]
    found = None
    # First of all: even the shape of a virtual data set may be a matter of the files it names.
    if creation.get_layout() == h5py.h5d.VIRTUAL or creation.get_external_count():
        found = "data in other files"
    elif dataset.shape is None or dataset.dtype.kind not in NUMBERS_AND_TEXT:
        found = f"values of type {str(dataset.dtype)[:80]!r}"
    elif unknown:
        found = f"an unknown filter {unknown[0]}"
    elif dataset.chunks and _chunk_bytes(dataset) > max(dataset.nbytes, SMALLEST_CHUNK_BYTES):
        found = f"chunks of {_chunk_bytes(dataset):,} bytes"
    if found:
        raise RefusedError(
            "it must hold plain numbers or text",
            f"{name!r} with {found}",
            "Save it again with h5py as plain data sets.",
        )


def _chunk_bytes(dataset: h5py.Dataset) -> int:
    return int(np.prod(dataset.chunks, dtype=object)) * dataset.dtype.itemsize


def _write(target: BinaryIO, name: str, dataset: h5py.Dataset, request: dict[str, Any]) -> None:
    _require_plain(name, dataset)
    described = {"name": name, "dtype": dataset.dtype.str, "shape": list(dataset.shape)}
    if request["rows"] is not None:
        for row in request["rows"]:
            if not 0 <= row < (dataset.shape or (0,))[0]:
                raise RefusedError(
                    f"{name!r} must have row {row}", f"{dataset.shape}", "Complete the data set."
                )
            _line(target, described | {"shape": list(dataset.shape[1:])})
            target.write(_raw(dataset[row]))
        return
    _line(target, described)
    if request["bytes"]:
        target.flush()
        if dataset.nbytes > request["bytes"]:
            raise SystemExit(1)  # the reader has stopped by itself: it knows the shape
        for slab in _slabs(dataset):
            target.write(_raw(slab))


def _slabs(dataset: h5py.Dataset) -> Iterator[Any]:
    """The whole content, a few rows at a time."""
    if not dataset.shape or not dataset.nbytes:
        yield dataset[()]
        return
    step = max(1, SLAB_BYTES * len(dataset) // dataset.nbytes)
    for start in range(0, len(dataset), step):
        yield dataset[start : start + step]


def _raw(values: Any) -> bytes:  # noqa: ANN401
    return np.ascontiguousarray(values).tobytes()


def _line(target: BinaryIO, content: dict[str, Any]) -> None:
    target.write(json.dumps(content).encode() + b"\n")


if __name__ == "__main__":
    main(sys.stdin.buffer, sys.stdout.buffer)
