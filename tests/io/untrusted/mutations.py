"""Sound files, slightly changed: bytes flipped, pieces cut, doubled or taken from another file."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np

# Values at which lengths, signs and instructions turn.
TELLING_BYTES = (0, 1, 2, 127, 128, 254, 255, *b".(]}0eusabRcNtlq\x80\x81\x85\x93\x94\x95")
KINDS = ("set", "cut_end", "cut", "repeat", "insert", "splice", "length")


@dataclass(frozen=True)
class Edit:
    """One change: what, where as a share of the file, and with which number."""

    kind: str
    place: float
    value: int


def random_edits(random: Random) -> list[Edit]:
    count = random.choice((1, 1, 1, 2, 3, 5, 10, 30))
    kinds = [random.choice(KINDS) if random.random() < 0.5 else "set" for _ in range(count)]
    return [Edit(kind, random.random() ** 1.5, random.randrange(2**32)) for kind in kinds]


def edited(data: bytes, edits: list[Edit], other: bytes) -> bytes:
    """The bytes with the edits done one after the other; splices come from ``other``."""
    content = bytearray(data)
    for edit in edits:
        place = int(edit.place * len(content))
        size = 1 + edit.value % 32
        if not content:
            break
        if edit.kind == "set":
            content[place] = _byte(edit.value)
        elif edit.kind == "cut_end":
            del content[place:]
        elif edit.kind == "cut":
            del content[place : place + size]
        elif edit.kind == "repeat":
            content[place:place] = content[place : place + size]
        elif edit.kind == "insert":
            content[place:place] = bytes([_byte(edit.value)])
        elif edit.kind == "splice":
            start = edit.value % (len(other) or 1)
            content[place : place + size] = other[start : start + size]
        elif edit.kind == "length":
            content[place : place + 4] = edit.value.to_bytes(4, "little")
    return bytes(content)


def _byte(value: int) -> int:
    if value % 3:
        return TELLING_BYTES[value % len(TELLING_BYTES)]
    return value % 256


def inside(path: Path) -> tuple[bytes, Callable[[bytes], bytes]]:
    """What lies within a packed file, and how it is packed again: checksums stop nothing then."""
    data = path.read_bytes()
    if data.startswith(b"PK"):
        return _member(data)
    for magic, unpack, pack in (
        (b"\x78", zlib.decompress, zlib.compress),
        (b"\x1f\x8b", gzip.decompress, gzip.compress),
        (b"BZh", bz2.decompress, bz2.compress),
        (b"\xfd7z", lzma.decompress, lzma.compress),
    ):
        if data.startswith(magic):
            return unpack(data), pack
    return data, bytes


def _member(data: bytes) -> tuple[bytes, Callable[[bytes], bytes]]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = next(name for name in members if name.endswith(("data.pkl", ".npy")))

    def pack(content: bytes) -> bytes:
        file = io.BytesIO()
        with zipfile.ZipFile(file, "w") as archive:
            for name, kept in members.items():
                archive.writestr(name, content if name == chosen else kept)
        return file.getvalue()

    return members[chosen], pack


def impure(value: object) -> list[object]:
    """What a plain structure must not hold: empty when it is one."""
    waiting, strange = [value], []
    while waiting:
        item = waiting.pop()
        if isinstance(item, dict):
            waiting += [*item, *item.values()]
        elif type(item) in (list, tuple):
            waiting += item
        elif isinstance(item, np.ndarray):
            strange += [item] if item.dtype.kind not in "biufcSU" else []
        elif type(item) not in (str, bytes, int, float, complex, bool, type(None)):
            strange.append(item)
    return strange
