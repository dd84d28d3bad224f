"""A path through noisy positions, as smooth as a moving body is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]

# Accelerations a body can hold for about so long; longer ones move it out of the picture.
ACCELERATION_TIME_S = 0.1


def smooth_path(
    positions: Array,
    confidence: Array,
    noise_m: float,
    acceleration_m_s2: float,
    step_s: float,
) -> Array:
    """The most likely path (T,) given positions (T,) at even steps; 0 confidence is no position.

    Least squares of ``confidence (path - positions)^2 / noise^2`` and the acceleration, integrated
    in time, over its usual square: between positions the path is a cubic, beyond them a line.
    """
    known = confidence > 0
    if known.sum() < 2 or len(positions) < 3:
        usual = np.average(positions[known], weights=confidence[known]) if known.any() else 0.0
        return np.where(known, positions, usual)
    weight = np.where(known, confidence, 0.0) / noise_m**2
    bands = _stiffness(acceleration_m_s2, step_s) * _second_difference_bands(len(positions))
    bands[-1] += weight
    return solveh_banded(bands, weight * np.where(known, positions, 0.0))


def bending(path: Array, acceleration_m_s2: float, step_s: float) -> float:
    """What ``smooth_path`` pays for the accelerations of a path (T,)."""
    return _stiffness(acceleration_m_s2, step_s) * float((np.diff(path, 2) ** 2).sum())


def _stiffness(acceleration_m_s2: float, step_s: float) -> float:
    # The second difference over step^2 is the acceleration; the sum over steps its integral.
    return 1.0 / (acceleration_m_s2**2 * ACCELERATION_TIME_S * step_s**3)


def _second_difference_bands(count: int) -> Array:
    """``D^T D`` of the second difference ``D``, upper banded form (3, count)."""
    bands = np.zeros((3, count))
    for first, coefficient in ((0, 1.0), (1, -2.0), (2, 1.0)):
        for second, other in ((0, 1.0), (1, -2.0), (2, 1.0)):
            if second >= first:
                bands[2 - (second - first), second : second + count - 2] += coefficient * other
    return bands
