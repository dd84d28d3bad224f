"""How each joint turns: its axes, and how far it usually and at most does.

Axes are the rest pose's (x to the person's left, -y where the person looks, z up); a leg swings
forward about -x, a knee bends about +x. Angles in degrees; the rest pose holds the arms 45 degrees
down and the elbows bent by 42.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.fit.fittable_body import JOINTS

Array = NDArray[np.float64]

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_ELBOW = (-0.78, 0.0, -0.62)  # The left one; it bends forwards and inwards.
_ELBOW_SIDE = (-0.62, 0.0, 0.78)


class _Turn(NamedTuple):
    """One axis of the left or middle joint; the right one is its mirror image."""

    joint: str
    axis: tuple[float, float, float]
    usual: float
    spread: float
    least: float
    most: float


_TURNS = (
    *(_Turn("spine04", axis, 0, 12, -45, 45) for axis in (_X, _Y, _Z)),
    *(_Turn("spine02", axis, 0, 12, -45, 45) for axis in (_X, _Y, _Z)),
    _Turn("neck01", _X, 0, 12, -40, 40),
    _Turn("neck01", _Y, 0, 10, -35, 35),
    _Turn("neck01", _Z, 0, 20, -60, 60),
    _Turn("head", _X, 0, 12, -35, 35),
    _Turn("head", _Y, 0, 8, -25, 25),
    _Turn("head", _Z, 0, 10, -35, 35),
    _Turn("clavicle", _Y, 0, 8, -35, 20),
    _Turn("clavicle", _Z, 0, 8, -25, 25),
    _Turn("upperarm01", _X, 0, 40, -170, 80),
    _Turn("upperarm01", _Y, 25, 35, -120, 60),
    _Turn("upperarm01", _Z, 0, 40, -120, 120),
    _Turn("lowerarm01", _ELBOW, -10, 35, -45, 108),
    _Turn("lowerarm01", _ELBOW_SIDE, 0, 4, -10, 10),
    _Turn("upperleg01", _X, -8, 30, -125, 35),
    _Turn("upperleg01", _Y, 0, 15, -60, 35),
    _Turn("upperleg01", _Z, 0, 15, -45, 45),
    _Turn("lowerleg01", _X, 12, 30, -8, 145),
    _Turn("lowerleg01", _Z, 0, 4, -10, 10),
    _Turn("foot", _X, 0, 15, -50, 35),
    _Turn("foot", _Z, 0, 8, -25, 25),
)


@dataclass(frozen=True, eq=False)
class Freedom:
    """All axes of all joints but the root; radians."""

    joint: NDArray[np.int64]  # (A,) row of ``JOINTS``
    axis: Array  # (A, 3) unit
    usual: Array  # (A,)
    spread: Array  # (A,)
    least: Array  # (A,)
    most: Array  # (A,)

    def rotation_vectors(self, angles: Array) -> Array:
        """Angles (T, A) as one rotation vector for each joint (T, J, 3)."""
        vectors = np.zeros((len(angles), len(JOINTS), 3))
        for number, (joint, axis) in enumerate(zip(self.joint, self.axis, strict=True)):
            vectors[:, joint] += angles[:, number, None] * axis
        return vectors


def _freedom() -> Freedom:
    rows: list[tuple[int, Array, float, float, float, float]] = []
    for turn in _TURNS:
        sides = [""] if turn.joint in JOINTS else [".L", ".R"]
        for side in sides:
            # A mirrored rotation about x keeps its sense; about y and z it turns the other way.
            mirror = np.array([1.0, -1.0, -1.0]) if side == ".R" else np.ones(3)
            joint = JOINTS.index(turn.joint + side)
            rows.append((joint, mirror * turn.axis, *turn[2:]))
    joints, axes, *degrees = zip(*rows, strict=True)
    return Freedom(np.array(joints), np.array(axes), *np.radians(np.array(degrees)))


FREEDOM = _freedom()
