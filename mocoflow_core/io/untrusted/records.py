"""What stands for an object while a pickle is being read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.refusal import damaged


class Record(ABC):
    """An object under construction.

    A pickle names an object first and describes it later, and may refer to it in between. So it
    is noted down in a record, and made from the notes when the whole file has been read.
    """

    @abstractmethod
    def build(self, state: object, machine: Machine) -> None:
        """Note the state that the file gives the object."""

    @abstractmethod
    def plain(self, allowance: Allowance) -> object:
        """The finished value, always the same one; it may hold further records."""


Outside = Callable[[object], object]  # resolves a reference to data outside of a pickle


class Machine(Protocol):
    """What an object under construction may use of the machine that reads the file."""

    allowance: Allowance
    stream: ByteStream

    def nested(self, stream: ByteStream, outside: Outside | None) -> object:
        """What another pickle holds, under the same allowance."""


@dataclass(frozen=True)
class Admitted:
    """A global name that a file may use, and the only things that may be done with it.

    ``call`` is ours and takes the file's arguments as data; ``new`` makes an empty record. Nothing
    is ever imported by a name that came out of a file.
    """

    name: str
    call: Callable[[Sequence[object], Machine], object] | None = None
    new: Callable[[], Record] | None = None


def integers(values: object, at_most: int) -> tuple[int, ...]:
    """A tuple or list of at most so many whole numbers, none negative: a shape or strides."""
    if not isinstance(values, tuple | list) or len(values) > at_most:
        raise damaged("a shape that is no short tuple")
    if not all(type(value) is int and 0 <= value < 2**62 for value in values):
        raise damaged("a shape that is not made of whole numbers")
    return tuple(values)


def latin1_bytes(data: object) -> bytes | bytearray:
    """Raw bytes, which Python 2 calls text."""
    if isinstance(data, str):
        return data.encode("latin1")
    if not isinstance(data, bytes | bytearray):
        raise damaged(f"{type(data).__name__} where raw bytes belong")
    return data
