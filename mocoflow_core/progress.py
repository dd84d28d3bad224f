"""How far a long computation is, told to whoever asks."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float, str], None]  # fraction in [0, 1], short text


def untold(fraction: float, text: str) -> None:
    """Nobody asks."""


def part_of(progress: Progress, start: float, end: float) -> Progress:
    """Progress of a part that spans these fractions of the whole."""
    return lambda fraction, text: progress(start + fraction * (end - start), text)
