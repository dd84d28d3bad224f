"""Damped Gauss-Newton steps for a clip: frames coupled by smoothness alone, a few shared unknowns.

The normal equations are banded with a border, so that a step costs time linear in the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from mocoflow_core.body.fit.posed_body import BodyPose

Array = NDArray[np.float64]

_FIRST_DAMPING = 1e-3
_LEAST_DAMPING, _MOST_DAMPING = 1e-7, 1e7
# Gains below this share of the cost end the search.
_SMALL_GAIN = 1e-4


@dataclass(frozen=True, eq=False)
class System:
    """Half a sum of squares around a pose: its value, gradient and curvature.

    T frames of D unknowns, S shared ones.
    """

    cost: float
    gradient: Array  # (T, D)
    shared_gradient: Array  # (S,)
    blocks: Array  # (T, D, D)
    border: Array  # (T, D, S)
    corner: Array  # (S, S)
    smoothness: Array  # (D,) stiffness of second differences

    @classmethod
    def nothing(cls, frames: int, unknowns: int, shared: int) -> System:
        """No residual at all: what sums start from."""
        return cls(
            0.0,
            np.zeros((frames, unknowns)),
            np.zeros(shared),
            np.zeros((frames, unknowns, unknowns)),
            np.zeros((frames, unknowns, shared)),
            np.zeros((shared, shared)),
            np.zeros(unknowns),
        )

    @classmethod
    def of(cls, cost: float, residuals: Array, by_frame: Array, by_shared: Array) -> System:
        """From weighted residuals (T, M) and their derivatives (T, M, D) and (T, M, S).

        ``cost`` may differ from half their squares where the weights hold down outliers.
        """
        turned = np.swapaxes(by_frame, 1, 2)
        flat = by_shared.reshape(-1, by_shared.shape[-1])
        return cls(
            cost,
            (turned @ residuals[..., None])[..., 0],
            flat.T @ residuals.ravel(),
            turned @ by_frame,
            turned @ by_shared,
            flat.T @ flat,
            np.zeros(by_frame.shape[-1]),
        )

    def __add__(self, other: System) -> System:
        return System(
            self.cost + other.cost,
            self.gradient + other.gradient,
            self.shared_gradient + other.shared_gradient,
            self.blocks + other.blocks,
            self.border + other.border,
            self.corner + other.corner,
            self.smoothness + other.smoothness,
        )

    def step(self, damping: float) -> tuple[Array, Array]:
        """The damped step (T, D) of the frames and (S,) of the shared unknowns."""
        frames, unknowns = self.gradient.shape
        bands = self._bands(damping)
        factor = (cholesky_banded(bands, lower=True, check_finite=False), True)
        border = self.border.reshape(frames * unknowns, -1)
        sides = np.column_stack([self.gradient.reshape(-1), border])
        solved = cho_solve_banded(factor, sides, check_finite=False)
        free, coupled = solved[:, 0], solved[:, 1:]
        corner = self.corner + damping * np.diag(np.diag(self.corner))
        shared = np.linalg.solve(
            corner - border.T @ coupled, border.T @ free - self.shared_gradient
        )
        return -(free + coupled @ shared).reshape(frames, unknowns), shared

    def _bands(self, damping: float) -> Array:
        """The frames' matrix, damped, in LAPACK's lower banded form."""
        frames, unknowns = self.gradient.shape
        bands = np.zeros((2 * unknowns + 1, frames, unknowns))
        for offset in range(unknowns):
            diagonal = np.diagonal(self.blocks, -offset, axis1=1, axis2=2)
            bands[offset, :, : unknowns - offset] = diagonal
        for first, coefficient in ((0, 1.0), (1, -2.0), (2, 1.0)):
            for second in range(first, 3):
                other = (1.0, -2.0, 1.0)[second]
                rows = bands[(second - first) * unknowns]
                rows[first : max(first, frames - 2 + first)] += (
                    coefficient * other * self.smoothness
                )
        bands[0] += damping * bands[0] + 1e-12
        return bands.reshape(len(bands), -1)


Term = Callable[[BodyPose], System]


def minimise(terms: Sequence[Term], pose: BodyPose, steps: int) -> BodyPose:
    """Levenberg-Marquardt: steps that raise the cost are not taken but damped more."""
    damping = _FIRST_DAMPING
    system = _total(terms, pose)
    for _ in range(steps):
        trial = _trial(system, pose, damping)
        proposed = _total(terms, trial) if trial is not None else None
        if trial is None or proposed is None or not proposed.cost < system.cost:
            damping *= 8.0
            if damping > _MOST_DAMPING:
                break
            continue
        gain = system.cost - proposed.cost
        pose, system = trial, proposed
        damping = max(damping / 5.0, _LEAST_DAMPING)
        if gain < _SMALL_GAIN * system.cost:
            break
    return pose


def _trial(system: System, pose: BodyPose, damping: float) -> BodyPose | None:
    """The pose after one step; None where rounding leaves no step."""
    try:
        step, shared = system.step(damping)
    except LinAlgError:
        return None
    if not (np.isfinite(step).all() and np.isfinite(shared).all()):
        return None
    return pose.moved(step, shared)


def _total(terms: Sequence[Term], pose: BodyPose) -> System:
    systems = [term(pose) for term in terms]
    return sum(systems[1:], systems[0])
