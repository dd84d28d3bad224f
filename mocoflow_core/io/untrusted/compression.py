"""Compressed files, unpacked in memory within the allowance."""

from __future__ import annotations

import bz2
import io
import lzma
import zlib
from collections.abc import Callable
from typing import Protocol

from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.refusal import damaged

_CHUNK = 2**20
# Unpacked bytes are held, and taken out once more by whoever reads them.
_HELD = 2
# A dictionary larger than that of xz -9 asks for memory before it gives any data.
_LZMA_MEMORY = 2**27


class _Unpacker(Protocol):
    @property
    def eof(self) -> bool: ...

    def pull(self, packed: bytes, at_most: int) -> bytes: ...


class _Zlib:
    def __init__(self, window: int) -> None:
        self._object = zlib.decompressobj(window)

    @property
    def eof(self) -> bool:
        return self._object.eof

    def pull(self, packed: bytes, at_most: int) -> bytes:
        return self._object.decompress(self._object.unconsumed_tail + packed, at_most)


class _Paced:
    """bz2's and lzma's objects keep what they have not used themselves."""

    def __init__(self, unpacker: bz2.BZ2Decompressor | lzma.LZMADecompressor) -> None:
        self._object = unpacker

    @property
    def eof(self) -> bool:
        return self._object.eof

    def pull(self, packed: bytes, at_most: int) -> bytes:
        return self._object.decompress(packed, at_most)


_UNPACKERS: dict[bytes, Callable[[], _Unpacker]] = {
    b"\x78": lambda: _Zlib(zlib.MAX_WBITS),
    b"\x1f\x8b": lambda: _Zlib(zlib.MAX_WBITS | 16),
    b"BZh": lambda: _Paced(bz2.BZ2Decompressor()),
    b"\xfd7zXZ": lambda: _Paced(lzma.LZMADecompressor(memlimit=_LZMA_MEMORY)),
    b"]\x00\x00": lambda: _Paced(lzma.LZMADecompressor(lzma.FORMAT_ALONE, _LZMA_MEMORY)),
}
LONGEST_MAGIC = max(map(len, _UNPACKERS))


def is_compressed(start: bytes) -> bool:
    """Whether a file that begins like this is one of zlib, gzip, bzip2, xz or lzma."""
    return any(start.startswith(magic) for magic in _UNPACKERS)


def unpacked(stream: ByteStream, start: bytes, allowance: Allowance) -> ByteStream:
    """The content of a compressed file that begins with ``start``; the stream is at its beginning.

    Raises:
        InputError: it grows beyond the limits, is damaged or cut short.
    """
    unpacker = next(make for magic, make in _UNPACKERS.items() if start.startswith(magic))()
    content = io.BytesIO()
    while not unpacker.eof:
        packed = stream.take(min(_CHUNK, stream.remaining))
        piece = unpacker.pull(packed, _CHUNK)
        if not piece and not packed and not unpacker.eof:
            raise damaged("a compressed file that ends too early")
        allowance.spend_bytes(_HELD * len(piece))
        content.write(piece)
    size = content.tell()
    content.seek(0)
    return ByteStream(content, size)
