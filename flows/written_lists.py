"""Numbers as people write them in options."""

from __future__ import annotations

from mocoflow_core.errors import InputError


def read_ranges(text: str) -> tuple[int, ...]:
    """``0,5,10-12`` as (0, 5, 10, 11, 12)."""
    numbers: list[int] = []
    try:
        for part in filter(None, text.split(",")):
            first, _, last = part.partition("-")
            numbers += range(int(first), int(last or first) + 1)
    except ValueError as error:
        raise InputError("Whole numbers and ranges", repr(text), "Write 0,5,10-20.") from error
    return tuple(numbers)


def read_numbers(text: str) -> tuple[float, ...]:
    """``0.1,0.25`` as (0.1, 0.25)."""
    try:
        return tuple(float(part) for part in filter(None, text.split(",")))
    except ValueError as error:
        raise InputError("Numbers with commas between", repr(text), "Write 0.1,0.25.") from error


def read_vector(text: str) -> tuple[float, float, float] | None:
    """``0,0,1.5`` as a vector; nothing as ``None``."""
    numbers = read_numbers(text)
    if not numbers:
        return None
    if len(numbers) != 3:
        raise InputError("Three numbers with commas between", repr(text), "Write 0,0,1.5.")
    return numbers
