"""One stiff or extreme case: what is swept, against what it is measured, how far off it may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

Value = TypeVar("Value", float, str)
Numbers = Tensor | NDArray[Any] | float


@dataclass(frozen=True, eq=False)
class Found:
    """What one value of a sweep gave.

    ``watched`` holds every value and gradient that must be finite besides the error itself.
    """

    error: float
    watched: tuple[Numbers, ...] = ()
    remark: str = ""

    @property
    def is_finite(self) -> bool:
        return all(_is_finite(numbers) for numbers in (self.error, *self.watched))


class LawBroken(AssertionError):
    """What a case found that no bound can excuse, in words."""


@dataclass(frozen=True, eq=False)
class Case(Generic[Value]):
    """An entry of the catalogue.

    It fails where a watched number is not finite, where the error exceeds the bound, and where
    ``measure`` raises anything.
    """

    name: str
    stiff: str  # what is stiff or extreme about it
    parameter: str  # what is swept, with its unit
    values: tuple[Value, ...]
    reference: str  # what the result is compared with
    measure: Callable[[Value], Found]
    bound: float | Callable[[Value], float]  # largest error, for all values or for each
    unit: str  # of error and bound
    reason: str  # why that bound
    quick: bool = True  # part of the tests

    def bound_at(self, value: Value) -> float:
        return self.bound(value) if callable(self.bound) else self.bound


def largest(difference: Numbers) -> float:
    """Largest magnitude of some numbers; 0 where there are none, nan where one is not finite."""
    numbers = _array(difference)
    return float(np.abs(numbers).max()) if numbers.size else 0.0


def require(holds: bool, words: str) -> None:
    """Raise LawBroken with the words unless the law holds."""
    if not holds:
        raise LawBroken(words)


def _array(numbers: Numbers) -> NDArray[Any]:
    if isinstance(numbers, Tensor):
        return numbers.detach().double().cpu().numpy()
    return np.asarray(numbers, np.float64)


def _is_finite(numbers: Numbers) -> bool:
    return bool(np.isfinite(_array(numbers)).all())
