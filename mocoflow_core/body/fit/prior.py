"""What is usual: angles, shapes, movements, and what the user knows of the person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from mocoflow_core.body.fit.fittable_body import READINGS, FittableBody
from mocoflow_core.body.fit.freedom import FREEDOM
from mocoflow_core.body.fit.least_squares import System
from mocoflow_core.body.fit.posed_body import ROOT, UNKNOWNS, BodyPose
from mocoflow_core.configuration import ConfigurationPart

Array = NDArray[np.float64]

# Accelerations last about so long, as in ``smooth_path``.
_ACCELERATION_S = 0.1


class PriorConfig(ConfigurationPart):
    """How people usually stand and move."""

    limit_deg: float = Field(4.0, gt=0, description="How far joints go beyond their limits.")
    acceleration_m_s2: float = Field(6.0, gt=0, description="Usual acceleration of the body.")
    turning_deg_s2: float = Field(1200.0, gt=0, description="The same of the body's rotation.")
    bending_deg_s2: float = Field(2500.0, gt=0, description="The same of the joints.")
    upright_deg: float = Field(25.0, gt=0, description="Usual lean of the hips where up is known.")
    error_seconds: float = Field(0.3, gt=0, description="How long errors of landmarks stay alike.")
    clothes_m: float = Field(0.015, gt=0, description="Usual standing off of clothes.")


@dataclass(frozen=True)
class Fact:
    """A reading of the shape that is known to ``spread``."""

    reading: str
    value: float
    spread: float


@dataclass(frozen=True, eq=False)
class Prior:
    """Minus the logarithm of how likely a body's movement is."""

    body: FittableBody
    step_s: float
    configuration: PriorConfig
    facts: Sequence[Fact] = ()
    up: Array | None = None  # (3,) unit, camera axes
    seen_share: float = 1.0  # of the frames, those that say anything

    def __call__(self, pose: BodyPose) -> System:
        return self._frames(pose) + self._smooth(pose) + self._shared(pose)

    def _frames(self, pose: BodyPose) -> System:
        frames = len(pose.places)
        limit = np.radians(self.configuration.limit_deg)
        usual = (pose.angles - FREEDOM.usual) / FREEDOM.spread
        over = (pose.angles - FREEDOM.most).clip(0) + (pose.angles - FREEDOM.least).clip(None, 0)
        beyond = over / limit
        slopes = np.stack(
            [np.broadcast_to(1 / FREEDOM.spread, usual.shape), (over != 0) / limit], 1
        )
        count = len(FREEDOM.joint)
        by_frame = np.zeros((frames, 2 * count + 3, UNKNOWNS))
        for kind in range(2):
            rows = np.arange(count)
            by_frame[:, kind * count + rows, ROOT + rows] = slopes[:, kind]
        residuals = np.concatenate([usual, beyond, np.zeros((frames, 3))], axis=1)
        if self.up is not None:
            residuals[:, -3:], by_frame[:, -3:, 3:ROOT] = self._lean(pose, self.up)
        shared = np.zeros((*residuals.shape, len(pose.shape) + len(pose.clothes)))
        return System.of(0.5 * float((residuals**2).sum()), residuals, by_frame, shared)

    def _lean(self, pose: BodyPose, up: Array) -> tuple[Array, Array]:
        """How far the hips lean from upright (T, 3), held down where they lie, with derivatives."""
        spread = np.radians(self.configuration.upright_deg)
        axis = pose.rotations[:, :, 2]
        lean = (axis - (axis @ up)[:, None] * up) / spread
        weight = 1 / (1 + ((1 - axis @ up) / (0.5 * spread**2)) / 4)
        across = (np.eye(3) - np.outer(up, up)) / spread
        turned = -_cross_matrices(axis)
        root = np.sqrt(weight)[:, None]
        return root * lean, root[..., None] * (across @ turned)

    def _smooth(self, pose: BodyPose) -> System:
        shared = len(pose.shape) + len(pose.clothes)
        nothing = System.nothing(len(pose.places), UNKNOWNS, shared)
        if len(pose.places) < 3:
            return nothing
        stiffness = self._stiffness()
        bent = _second_differences(pose)
        gradient = np.zeros_like(nothing.gradient)
        for row, coefficient in enumerate((1.0, -2.0, 1.0)):
            gradient[row : len(gradient) - 2 + row] += coefficient * stiffness * bent
        cost = 0.5 * float((stiffness * bent**2).sum())
        return System(
            cost,
            gradient,
            nothing.shared_gradient,
            nothing.blocks,
            nothing.border,
            nothing.corner,
            stiffness,
        )

    def _stiffness(self) -> Array:
        usual = np.empty(UNKNOWNS)
        usual[:3] = self.configuration.acceleration_m_s2
        usual[3:ROOT] = np.radians(self.configuration.turning_deg_s2)
        usual[ROOT:] = np.radians(self.configuration.bending_deg_s2)
        return 1.0 / (usual**2 * _ACCELERATION_S * self.step_s**3)

    def _shared(self, pose: BodyPose) -> System:
        """Shapes are whitened; clothes stand off; facts hold."""
        shapes, parts = len(pose.shape), len(pose.clothes)
        rows = [np.eye(shapes + parts)]
        rows[0][shapes:] /= self.configuration.clothes_m
        residuals = [pose.shape, pose.clothes / self.configuration.clothes_m]
        for fact in self.facts:
            reading = self.body.readings[READINGS.index(fact.reading), :-1]
            rows.append(np.concatenate([reading, np.zeros(parts)])[None] / fact.spread)
            beside = self.body.reading(fact.reading, pose.shape) - fact.value
            residuals.append(np.array([beside / fact.spread]))
        slopes, off = np.concatenate(rows), np.concatenate(residuals)
        # Each frame counts in full, although its errors are its neighbours': what is shared by all
        # frames has to weigh as much more.
        alike = min(len(pose.places), self.configuration.error_seconds / self.step_s)
        heavier = float(np.sqrt(max(1.0, self.seen_share * alike)))
        weighed = (heavier * slopes, heavier * off)
        return self._common(pose, *weighed)

    def _common(self, pose: BodyPose, slopes: Array, off: Array) -> System:
        """Residuals (M,) of the shared unknowns alone, with derivatives (M, S)."""
        nothing = System.nothing(len(pose.places), UNKNOWNS, slopes.shape[1])
        return System(
            0.5 * float(off @ off),
            nothing.gradient,
            slopes.T @ off,
            nothing.blocks,
            nothing.border,
            slopes.T @ slopes,
            nothing.smoothness,
        )


def _second_differences(pose: BodyPose) -> Array:
    """(T - 2, UNKNOWNS): rotations as the change of the step from frame to frame."""
    turns = pose.rotations[1:] @ np.swapaxes(pose.rotations[:-1], 1, 2)
    turning = Rotation.from_matrix(turns).as_rotvec()
    return np.concatenate(
        [
            np.diff(pose.places, 2, axis=0),
            np.diff(turning, axis=0),
            np.diff(pose.angles, 2, axis=0),
        ],
        axis=1,
    )


def _cross_matrices(vectors: Array) -> Array:
    """(..., 3, 3) with ``M w = v x w``."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*vectors.shape, 3)
