"""Bytes in order, never more than there are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mocoflow_core.io.untrusted.refusal import damaged


class ByteStream:
    """A file that is read once, forwards; a length is checked before memory is taken for it."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self.size = size
        self.remaining = size

    @classmethod
    def over(cls, data: bytes) -> ByteStream:
        return cls(BytesIO(data), len(data))

    @property
    def position(self) -> int:
        return self.size - self.remaining

    def take(self, count: int) -> bytes:
        """The next ``count`` bytes. Raises InputError where the file ends before."""
        self.require(count)
        data = self._file.read(count)
        if len(data) != count:
            raise damaged("a file that became shorter while it was read")
        self.remaining -= count
        return data

    def fill(self, target: memoryview) -> None:
        """Fill ``target`` with the next bytes, without a copy in between."""
        self.require(target.nbytes)
        done = 0
        while done < target.nbytes:
            count = self._file.readinto(target[done:])  # type: ignore[attr-defined]
            if not count:
                raise damaged("a file that became shorter while it was read")
            done += count
        self.remaining -= done

    def line(self) -> bytes:
        """The bytes up to the next line feed, without it."""
        data = self._file.readline()
        self.remaining -= len(data)
        if not data.endswith(b"\n"):
            raise damaged("a text line without an end")
        return data[:-1]

    def rest(self) -> bytes:
        return self.take(self.remaining)

    def require(self, count: int) -> None:
        """Raise InputError unless so many bytes are left."""
        if not 0 <= count <= self.remaining:
            raise damaged(
                f"{count:,} bytes declared at byte {self.position:,} of {self.size:,}, "
                f"{self.remaining:,} left"
            )


@contextmanager
def opened(path: Path) -> Iterator[ByteStream]:
    """The file at ``path`` as a stream."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        yield ByteStream(file, size)
