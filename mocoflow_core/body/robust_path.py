"""A smooth path through positions of which some are wrong altogether."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.smooth_path import bending, smooth_path

Array = NDArray[np.float64]

# A position so many times the usual noise off the path has lost three quarters of its weight.
FAR_OFF = 4.0
# Accelerations allowed, as shares of the usual one: a stiff path is not led astray by a few wrong
# positions in a row, and it is made softer step by step.
SOFTER = (1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0)
ROUNDS = 4  # of weighing anew at each of them
# Positions that keep less than this of their weight count as left out.
LEFT_OUT = 0.25
# Among fewer positions none can be called the wrong one.
LEAST_TO_DOUBT = 4
# Median absolute value of a normal distribution to its standard deviation.
MAD_TO_DEVIATION = 1.4826


@dataclass(frozen=True, eq=False)
class _Track:
    """What is known: positions (T, D), their confidence (T,), the noise (D,) of a sure one."""

    positions: Array
    confidence: Array
    noise_m: Array
    acceleration_m_s2: float
    step_s: float

    @property
    def known(self) -> NDArray[np.bool_]:
        return self.confidence > 0

    def path(self, kept: Array, softness: float = 1.0) -> Array:
        """The smooth path (T, D) where every position keeps a share (T,) of its confidence."""
        weights, acceleration = self.confidence * kept, self.acceleration_m_s2 * softness
        axes = [
            smooth_path(values, weights, noise, acceleration, self.step_s)
            for values, noise in zip(self.positions.T, self.noise_m, strict=True)
        ]
        return np.stack(axes, axis=-1)

    def off(self, path: Array) -> Array:
        """How far positions (T, D) lie off a path in the noise of their own confidence."""
        return np.sqrt(self.confidence)[:, None] * (self.positions - path) / self.noise_m

    def usual(self, path: Array) -> Array:
        """The noise (D,) that most positions share, in units of the one they should have."""
        middle = np.median(np.abs(self.off(path)[self.known]), axis=0)
        return np.maximum(MAD_TO_DEVIATION * middle, 1.0)

    def kept(self, path: Array, usual: Array) -> Array:
        """The weights (T,) of the Geman-McClure cost."""
        return (1 + ((self.off(path) / usual) ** 2).sum(axis=-1) / FAR_OFF**2) ** -2

    def cost(self, path: Array, usual: Array) -> float:
        """Geman-McClure's cost of the positions and that of the path's accelerations."""
        off = ((self.off(path) / usual) ** 2).sum(axis=-1)
        bends = [bending(axis, self.acceleration_m_s2, self.step_s) for axis in path.T]
        return float((off / (1 + off / FAR_OFF**2)).sum() + (np.array(bends) / usual**2).sum())

    def settled(self, kept: Array, usual: Array) -> tuple[Array, Array]:
        """Path and weights after some rounds of weighing anew."""
        for _ in range(ROUNDS):
            path = self.path(kept)
            kept = self.kept(path, usual)
        return self.path(kept), kept


def robust_path(
    positions: Array,
    confidence: Array,
    noise_m: Array,
    acceleration_m_s2: float,
    step_s: float,
) -> tuple[Array, Array]:
    """A path (T, D) through positions (T, D), and the share (T,) of its confidence each keeps.

    As ``smooth_path`` on every axis with its usual noise (D,), but a position that is far off on
    any axis loses its weight on all (Geman and McClure's cost). The path starts stiff, so that
    wrong positions stand out although they follow each other, and becomes softer. What is then
    left out may be a leap: each run of it is let back in where that costs less. Noise that
    most positions share counts as usual, however large.
    """
    track = _Track(positions, confidence, noise_m, acceleration_m_s2, step_s)
    kept = np.ones(len(positions))
    if track.known.sum() < LEAST_TO_DOUBT:
        return track.path(kept), kept
    for softness in SOFTER:
        for _ in range(ROUNDS):
            path = track.path(kept, softness)
            usual = track.usual(path)
            kept = track.kept(path, usual)
    return _readmitted(track, kept, usual)


def _readmitted(track: _Track, kept: Array, usual: Array) -> tuple[Array, Array]:
    """Path and weights with every run of left-out positions that the path can follow cheaply."""
    path, kept = track.settled(kept, usual)
    least = track.cost(path, usual)
    left_out = np.flatnonzero(track.known & (kept < LEFT_OUT))
    known_rank = np.cumsum(track.known)
    # Runs are of known positions: what lies between them does not part them.
    for run in np.split(left_out, np.flatnonzero(np.diff(known_rank[left_out]) > 1) + 1):
        trial = kept.copy()
        trial[run] = 1.0
        other_path, other_kept = track.settled(trial, usual)
        cost = track.cost(other_path, usual)
        if cost < least:
            path, kept, least = other_path, other_kept, cost
    return path, kept
