"""One curve from the curves of several seeds: their median, between the best and the worst."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.metrics.curve import CurveRow, as_error

# Neither a time nor an error of zero has a place on a logarithmic axis.
LEAST_SECONDS, LEAST_ERROR = 1e-3, 1e-6

Array = NDArray[np.float64]


class SeedBand(NamedTuple):
    """Errors of all seeds at common moments, each array (N,)."""

    seconds: Array
    median: Array
    low: Array
    high: Array


def seed_band(runs: Iterable[Sequence[CurveRow]], metric: str) -> SeedBand | None:
    """Median and range of the error over the training clock's wall seconds.

    Seeds are measured at different moments. Between two of its measurements a seed's error is
    interpolated, log error over log seconds; before its first and after its last one it has none.
    The band covers the moments that every seed has, and nothing is extrapolated. None where there
    is no such moment.
    """
    curves = [curve for run in runs if len(curve := _log_curve(run, metric))]
    if not curves:
        return None
    start = max(curve[0, 0] for curve in curves)
    end = min(curve[-1, 0] for curve in curves)
    knots = np.unique(np.concatenate([curve[:, 0] for curve in curves]))
    knots = knots[(knots >= start) & (knots <= end)]
    if not len(knots):
        return None
    errors = np.exp([np.interp(knots, curve[:, 0], curve[:, 1]) for curve in curves])
    return SeedBand(
        np.exp(knots), np.median(errors, axis=0), errors.min(axis=0), errors.max(axis=0)
    )


def last_points(runs: Iterable[Sequence[CurveRow]], metric: str) -> Array:
    """Seconds and error (seeds, 2) where each seed ended."""
    curves = [curve for run in runs if len(curve := _log_curve(run, metric))]
    return np.exp(np.array([curve[-1] for curve in curves]).reshape(-1, 2))


def _log_curve(run: Sequence[CurveRow], metric: str) -> Array:
    """Log seconds, rising, and log error (N, 2) of one run."""
    errors = {
        max(row.wall_s, LEAST_SECONDS): max(as_error(row.metric, row.value), LEAST_ERROR)
        for row in run
        if row.metric == metric and np.isfinite(row.value)
    }
    return np.log(np.array(sorted(errors.items())).reshape(-1, 2))
