"""A path through noisy positions, as smooth as a moving body is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]

# Accelerations a body can hold for about so long; longer ones move it out of the picture.
ACCELERATION_TIME_S = 0.1
# A position so many times its noise off the path has lost three quarters of its weight.
FAR_OFF = 4.0
# The cost becomes less convex by this factor from one round to the next.
RELAXED_LESS = 1.4
# Among fewer positions none can be called the wrong one.
LEAST_TO_DOUBT = 4


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
    # The second difference over step^2 is the acceleration; the sum over steps its integral.
    stiffness = 1.0 / (acceleration_m_s2**2 * ACCELERATION_TIME_S * step_s**3)
    bands = stiffness * _second_difference_bands(len(positions))
    bands[-1] += weight
    return solveh_banded(bands, weight * np.where(known, positions, 0.0))


def robust_path(
    positions: Array,
    confidence: Array,
    noise_m: Array,
    acceleration_m_s2: float,
    step_s: float,
) -> tuple[Array, Array]:
    """The path (T, D) through positions (T, D) of which some are wrong altogether, and the share
    (T,) of its confidence that each position keeps: about 1 near the path, about 0 far away.

    As ``smooth_path`` on every axis with its usual noise (D,), but with the Geman-McClure cost of
    all axes together, made convex first and less and less so (graduated non-convexity, Yang et
    al. 2020): no start has to be known, and what is far off loses all its pull. Noise that most
    positions share counts as usual, however large.
    """
    known = confidence > 0
    kept = np.ones(len(positions))
    path = _smooth_axes(positions, confidence, noise_m, acceleration_m_s2, step_s)
    if known.sum() < LEAST_TO_DOUBT:
        return path, kept
    off = _misfit(positions, path, confidence, noise_m)
    relaxed = max(2 * float(off.max()) / FAR_OFF**2, 1.0)
    while True:
        usual = max(1.0, float(np.median(off[known])))
        cost = relaxed * FAR_OFF**2 * usual
        kept = (cost / (cost + off)) ** 2
        path = _smooth_axes(positions, confidence * kept, noise_m, acceleration_m_s2, step_s)
        off = _misfit(positions, path, confidence, noise_m)
        if relaxed <= 1:
            return path, kept
        relaxed = max(relaxed / RELAXED_LESS, 1.0)


def _smooth_axes(
    positions: Array, confidence: Array, noise_m: Array, acceleration_m_s2: float, step_s: float
) -> Array:
    axes = [
        smooth_path(values, confidence, noise, acceleration_m_s2, step_s)
        for values, noise in zip(positions.T, noise_m, strict=True)
    ]
    return np.stack(axes, axis=-1)


def _misfit(positions: Array, path: Array, confidence: Array, noise_m: Array) -> Array:
    """Squared distance (T,) of each position to the path in its own noise; 0 where unknown."""
    off = ((positions - path) / noise_m) ** 2
    return np.where(confidence > 0, confidence * off.sum(axis=-1), 0.0)


def _second_difference_bands(count: int) -> Array:
    """``D^T D`` of the second difference ``D``, upper banded form (3, count)."""
    bands = np.zeros((3, count))
    for first, coefficient in ((0, 1.0), (1, -2.0), (2, 1.0)):
        for second, other in ((0, 1.0), (1, -2.0), (2, 1.0)):
            if second >= first:
                bands[2 - (second - first), second : second + count - 2] += coefficient * other
    return bands
