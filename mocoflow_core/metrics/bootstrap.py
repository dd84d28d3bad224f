"""How far a mean over views could lie off because these views were looked at and not others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

SHARE = 0.95
RESAMPLES = 2000


class Interval(NamedTuple):
    """Bounds of a mean."""

    low: float
    high: float


def mean_interval(values: Sequence[float], seed: int = 0) -> Interval:
    """Percentile bootstrap interval (95 %) of the mean, views drawn with replacement.

    Neighbouring frames resemble each other, so the interval is rather too short than too long.
    NaN for fewer than two values.
    """
    if len(values) < 2:
        return Interval(float("nan"), float("nan"))
    generator = np.random.default_rng(seed)
    drawn = generator.integers(len(values), size=(RESAMPLES, len(values)))
    means = np.asarray(values, np.float64)[drawn].mean(axis=1)
    tail = 0.5 * (1.0 - SHARE)
    low, high = np.quantile(means, [tail, 1.0 - tail])
    return Interval(float(low), float(high))
