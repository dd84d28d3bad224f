"""How much a file may ask for beyond its own size."""

from __future__ import annotations

from dataclasses import dataclass

from mocoflow_core.errors import InputError

_GIB = 2**30


# What the smallest instruction leaves in memory, an item with its place in a list or a memo; and
# what a container takes beside its items while the plain structure is made. Both measured.
STEP_BYTES, CONTAINER_BYTES = 100, 400


@dataclass(frozen=True)
class Limits:
    """Bounds of one reading.

    Memory that a file asks for beyond its own bytes grows with the file: at most ``growth`` times
    its size, in any case ``free_growth_bytes``, never more than ``made_bytes``. All that is
    decompressed, copied, repeated or filled in counts, and every item: a file of 10 MB stays below
    1 GB. An item takes 1.5 to 12 microseconds, so the most items two minutes.
    """

    made_bytes: int = 4 * _GIB
    growth: int = 100  # pictures of masks shrink by so much, poses and vertices by less than ten
    free_growth_bytes: int = _GIB // 4
    steps: int = 10_000_000  # pickle instructions and items
    depth: int = 64  # containers within containers
    members: int = 100_000  # entries of an archive, data sets of an HDF5 file
    dimensions: int = 16  # of an array
    seconds: int = 120  # of computing in the HDF5 library, and of waiting for it

    def made_from(self, file_bytes: int) -> int:
        """The bytes that a file of this size may ask for beyond its own."""
        return min(self.made_bytes, max(self.free_growth_bytes, self.growth * file_bytes))


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

    def __init__(self, limits: Limits, file_bytes: int) -> None:
        self.limits = limits
        self.file_bytes = file_bytes
        self.left_bytes = limits.made_from(file_bytes)
        self._own = OwnBytes(file_bytes)
        self._steps = limits.steps

    def spend_bytes(self, count: int) -> None:
        """Raise InputError once the file has asked for more memory than it may."""
        self.left_bytes -= count
        if self.left_bytes < 0:
            raise self._too_large()

    def spend_copy(self, count: int) -> None:
        """The same for copies of bytes that lie in the file, each of which is free once."""
        self.spend_bytes(self._own.beyond(count))

    def spend_step(self, count: int = 1) -> None:
        """Raise InputError once the file holds more items than it may."""
        self._steps -= count
        self.left_bytes -= STEP_BYTES * count
        if self._steps < 0:
            raise too_many_items(self.limits)
        if self.left_bytes < 0:
            raise self._too_large()

    def _too_large(self) -> InputError:
        megabytes = self.limits.made_from(self.file_bytes) / 1e6
        return InputError(
            f"its content must fit into {megabytes:,.0f} MB once unpacked",
            f"{self.file_bytes:,} bytes that ask for more",
            "Get the file from its maker again; cut a long recording into parts.",
        )


def too_many_items(limits: Limits) -> InputError:
    return InputError(
        f"it must hold at most {limits.steps:,} items",
        "a file with more",
        "Keep long series as arrays, not as lists, and get the file from its maker again.",
    )
