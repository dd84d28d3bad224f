"""Instructions of a pickle that spell out one value: numbers, text, bytes.

Source: CPython, ``Lib/pickletools.py``. Text of Python 2 is read as latin1, which keeps every byte.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Mapping
from struct import Struct

from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.refusal import damaged

# Long enough for every number in a data set; reading decimal digits takes their square.
_LONGEST_NUMBER = 64

_LITTLE = {1: "<B", 2: "<H", 4: "<I", 8: "<Q"}


def _fixed(layout: str) -> Callable[[ByteStream], object]:
    form = Struct(layout)
    return lambda stream: form.unpack(stream.take(form.size))[0]


def _counted(width: int, finish: Callable[[bytes], object]) -> Callable[[ByteStream], object]:
    form = Struct(_LITTLE[width])

    def read(stream: ByteStream) -> object:
        return finish(stream.take(form.unpack(stream.take(width))[0]))

    return read


def _constant(value: object) -> Callable[[ByteStream], object]:
    return lambda stream: value


def _utf8(data: bytes) -> str:
    return data.decode("utf-8", "surrogatepass")


def _latin1(data: bytes) -> str:
    return data.decode("latin1")


def _binary_long(data: bytes) -> int:
    if len(data) > _LONGEST_NUMBER:
        raise damaged(f"a number of {len(data)} bytes")
    return int.from_bytes(data, "little", signed=True)


def _digits(stream: ByteStream) -> bytes:
    line = stream.line()
    if len(line) > _LONGEST_NUMBER:
        raise damaged(f"a number of {len(line)} digits")
    return line


def _integer_line(stream: ByteStream) -> object:
    line = _digits(stream)
    if line in (b"00", b"01"):
        return line == b"01"
    return int(line)


def _long_line(stream: ByteStream) -> object:
    return int(_digits(stream).removesuffix(b"L"))


def _float_line(stream: ByteStream) -> object:
    return float(_digits(stream))


def _quoted_line(stream: ByteStream) -> object:
    line = stream.line()
    if len(line) < 2 or line[:1] != line[-1:] or line[:1] not in (b"'", b'"'):
        raise damaged("text without quotes")
    return codecs.escape_decode(line[1:-1])[0].decode("latin1")


def _unicode_line(stream: ByteStream) -> object:
    return stream.line().decode("raw-unicode-escape")


def memo_place(stream: ByteStream, width: int) -> int:
    """A number of so many bytes, or for width 0 a line of digits."""
    if width:
        return int.from_bytes(stream.take(width), "little")
    return int(_digits(stream))


LITERALS: Mapping[bytes, Callable[[ByteStream], object]] = {
    b"N": _constant(None),
    b"\x88": _constant(True),
    b"\x89": _constant(False),
    b")": _constant(()),
    b"K": _fixed("<B"),
    b"M": _fixed("<H"),
    b"J": _fixed("<i"),
    b"G": _fixed(">d"),
    b"I": _integer_line,
    b"L": _long_line,
    b"F": _float_line,
    b"S": _quoted_line,
    b"V": _unicode_line,
    b"\x8a": _counted(1, _binary_long),
    b"\x8b": _counted(4, _binary_long),
    b"U": _counted(1, _latin1),
    b"T": _counted(4, _latin1),
    b"\x8c": _counted(1, _utf8),
    b"X": _counted(4, _utf8),
    b"\x8d": _counted(8, _utf8),
    b"C": _counted(1, bytes),
    b"B": _counted(4, bytes),
    b"\x8e": _counted(8, bytes),
    b"\x96": _counted(8, bytes),  # a bytearray: nobody changes it here
}
