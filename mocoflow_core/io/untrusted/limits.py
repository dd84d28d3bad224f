"""How much a file may ask for beyond its own size."""

from __future__ import annotations

from dataclasses import dataclass

from mocoflow_core.errors import InputError

_GIB = 2**30


@dataclass(frozen=True)
class Limits:
    """Bounds of one reading. Bytes that lie in the file as they are need none: they are there."""

    made_bytes: int = 4 * _GIB  # decompressed, repeated or filled in: not in the file
    growth: int = 200  # decompressed over compressed size; video masks shrink by about a hundred
    free_growth_bytes: int = _GIB // 4  # below this the ratio is nobody's concern
    steps: int = 10_000_000  # pickle instructions, about a microsecond and at most 100 bytes each
    depth: int = 64  # containers within containers
    members: int = 100_000  # entries of an archive, data sets of an HDF5 file
    dimensions: int = 16  # of an array
    seconds: int = 120  # of computing in the HDF5 library


class OwnBytes:
    """Bytes that lie in a file and may be used once for nothing; what is used again costs."""

    def __init__(self, count: int) -> None:
        self._left = count

    def beyond(self, count: int) -> int:
        """How many of the next ``count`` bytes are not the file's own any more."""
        own = min(count, self._left)
        self._left -= own
        return count - own


class Allowance:
    """What is left of the limits while one file is read, whatever is nested in it."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._bytes = limits.made_bytes
        self._steps = limits.steps

    def spend_bytes(self, count: int) -> None:
        """Raise InputError once the file has asked for more memory than it may."""
        self._bytes -= count
        if self._bytes < 0:
            raise InputError(
                f"its content must fit into {self.limits.made_bytes / _GIB:g} GiB once unpacked",
                "a file that asks for more",
                "Get the file from its maker again; cut a long recording into parts.",
            )

    def spend_step(self) -> None:
        """Raise InputError once the file holds more items than it may."""
        self._steps -= 1
        if self._steps < 0:
            raise too_many_items(self.limits)

    def require_growth(self, packed_bytes: int, bytes_so_far: int) -> None:
        """Raise InputError once a packed file of this size grows more than data does."""
        limit = max(self.limits.free_growth_bytes, packed_bytes * self.limits.growth)
        if bytes_so_far > limit:
            raise InputError(
                "it must unpack to a sensible size",
                f"{packed_bytes:,} bytes that grow beyond {limit:,}",
                "Get the file from its maker again.",
            )


def too_many_items(limits: Limits) -> InputError:
    return InputError(
        f"it must hold at most {limits.steps:,} items",
        "a file with more",
        "Keep long series as arrays, not as lists, and get the file from its maker again.",
    )
