"""Motions: a root path and joint rotations over time.

Joint rotations turn about the rest pose's axes: x to the person's left, -y where the person
looks, z up. So a leg or an arm swings forward about -x, a knee bends about +x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Times = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Root and joints of T frames. ``root_position`` is the place of the root joint, metres."""

    root_rotation: Rotation  # (T,) rest pose -> world
    root_position: NDArray[np.float64]  # (T, 3)
    joints: dict[str, Rotation]  # bone -> (T,) relative to its parent

    def __len__(self) -> int:
        return len(self.root_position)


def _about(axis: str, degrees: NDArray[np.float64] | float, times: Times) -> Rotation:
    return Rotation.from_euler(axis, np.broadcast_to(degrees, times.shape)[:, None], degrees=True)


def _wave(times: Times, cycles: float, phase: float = 0.0) -> NDArray[np.float64]:
    """A sine with whole or fractional cycles over the clip; ``phase`` in cycles."""
    return np.sin(2 * np.pi * (cycles * times + phase))


def _arm(
    side: str, times: Times, lowered: NDArray[np.float64] | float, forward: NDArray[np.float64]
) -> Rotation:
    """Upper arm: degrees below the rest pose's slant, then degrees forward."""
    sign = 1 if side == "L" else -1
    return _about("x", -forward, times) * _about("y", sign * np.asarray(lowered), times)


def _elbow(side: str, times: Times, bent: NDArray[np.float64] | float) -> Rotation:
    """Lower arm, bent forward and a little inwards by degrees."""
    sign = 1 if side == "L" else -1
    axis = np.array([-0.8, 0.0, -0.6 * sign])
    angles = np.radians(np.broadcast_to(bent, times.shape))
    return Rotation.from_rotvec(angles[:, None] * axis)


def _motion(
    times: Times,
    heading: NDArray[np.float64],
    joints: dict[str, Rotation],
    path: NDArray[np.float64] | None = None,
) -> Motion:
    """A motion from a heading in degrees and an optional ground path (T, 2) in metres."""
    position = np.zeros((len(times), 3))
    if path is not None:
        position[:, :2] = path
    return Motion(_about("z", heading, times), position, joints)


def turn(times: Times) -> Motion:
    """One full turn on the spot, arms away from the body, limbs never quite still."""
    joints = {
        "upperarm01.L": _arm("L", times, 12 + 8 * _wave(times, 2), 14 * _wave(times, 2.5)),
        "upperarm01.R": _arm("R", times, 12 + 8 * _wave(times, 2, 0.4), -14 * _wave(times, 2.5)),
        "lowerarm01.L": _elbow("L", times, 4 + 16 * _wave(times, 2, 0.1)),
        "lowerarm01.R": _elbow("R", times, 4 + 16 * _wave(times, 2, 0.6)),
        "upperleg01.L": _about("x", -8 * np.maximum(0, _wave(times, 3)), times),
        "upperleg01.R": _about("x", -8 * np.maximum(0, _wave(times, 3, 0.5)), times),
        "lowerleg01.L": _about("x", 16 * np.maximum(0, _wave(times, 3)), times),
        "lowerleg01.R": _about("x", 16 * np.maximum(0, _wave(times, 3, 0.5)), times),
        "spine03": _about("z", 5 * _wave(times, 2), times),
        "neck02": _about("z", 9 * _wave(times, 2, 0.3), times),
    }
    # A clip of T frames ends one step before the start's heading returns.
    step = times[1] - times[0] if len(times) > 1 else 0.0
    return _motion(times, 360 * times / (1 + step), joints)


def still(times: Times) -> Motion:
    """Standing without any movement."""
    zero = np.zeros_like(times)
    joints = {
        "upperarm01.L": _arm("L", times, 22.0, zero),
        "upperarm01.R": _arm("R", times, 22.0, zero),
        "lowerarm01.L": _elbow("L", times, 12.0),
        "lowerarm01.R": _elbow("R", times, 12.0),
    }
    return _motion(times, np.full_like(times, 15.0), joints)


def walk_circle(times: Times) -> Motion:
    """One round on a circle of 0.3 m radius, walking forwards in small steps."""
    gait = 3.0  # Cycles of two steps over the round, each step about 30 cm.
    left, right = _wave(times, gait), _wave(times, gait, 0.5)
    joints = {
        "upperleg01.L": _about("x", -11 * left, times),
        "upperleg01.R": _about("x", -11 * right, times),
        "lowerleg01.L": _about("x", 5 + 30 * np.maximum(0, _wave(times, gait, 0.25)), times),
        "lowerleg01.R": _about("x", 5 + 30 * np.maximum(0, _wave(times, gait, 0.75)), times),
        "foot.L": _about("x", 12 * _wave(times, gait, 0.3), times),
        "foot.R": _about("x", 12 * _wave(times, gait, 0.8), times),
        "upperarm01.L": _arm("L", times, 30.0, 22 * right),
        "upperarm01.R": _arm("R", times, 30.0, 22 * left),
        "lowerarm01.L": _elbow("L", times, 25 + 12 * right),
        "lowerarm01.R": _elbow("R", times, 25 + 12 * left),
        "spine03": _about("z", 6 * left, times),
    }
    angle = 2 * np.pi * times
    path = 0.30 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    # The person looks along -y at heading 0 and walks along the circle's tangent.
    return _motion(times, 180 + np.degrees(angle), joints, path)


def dance(times: Times) -> Motion:
    """Arms raised and crossed over, knees and hips moving, half turns to and fro."""
    lift = 35 * _wave(times, 2)
    joints = {
        "upperarm01.L": _arm("L", times, -25 - lift, 25 * _wave(times, 3)),
        "upperarm01.R": _arm("R", times, -25 + lift, 25 * _wave(times, 3, 0.3)),
        "lowerarm01.L": _elbow("L", times, 45 + 35 * _wave(times, 4)),
        "lowerarm01.R": _elbow("R", times, 45 + 35 * _wave(times, 4, 0.4)),
        "upperleg01.L": _about("x", -28 * np.maximum(0, _wave(times, 4)), times)
        * _about("y", -8 - 6 * _wave(times, 2), times),
        "upperleg01.R": _about("x", -28 * np.maximum(0, _wave(times, 4, 0.5)), times)
        * _about("y", 8 - 6 * _wave(times, 2), times),
        "lowerleg01.L": _about("x", 45 * np.maximum(0, _wave(times, 4)), times),
        "lowerleg01.R": _about("x", 45 * np.maximum(0, _wave(times, 4, 0.5)), times),
        "spine04": _about("y", 9 * _wave(times, 2), times),
        "spine02": _about("z", 14 * _wave(times, 3), times)
        * _about("x", 8 * _wave(times, 2), times),
        "neck02": _about("z", 14 * _wave(times, 3, 0.5), times),
        "head": _about("x", 8 * _wave(times, 4), times),
    }
    path = 0.12 * np.stack([_wave(times, 2), _wave(times, 1)], axis=-1)
    return _motion(times, 200 * _wave(times, 1), joints, path)


def fast_spin(times: Times) -> Motion:
    """Three turns on the spot with the arms flung out: 20 degrees and more between frames."""
    joints = {
        "upperarm01.L": _arm("L", times, -20 + 15 * _wave(times, 3), 10 * _wave(times, 3)),
        "upperarm01.R": _arm("R", times, -20 + 15 * _wave(times, 3, 0.5), 10 * _wave(times, 3)),
        "lowerarm01.L": _elbow("L", times, 20 + 15 * _wave(times, 3, 0.2)),
        "lowerarm01.R": _elbow("R", times, 20 + 15 * _wave(times, 3, 0.7)),
        "upperleg01.L": _about("x", -14 * np.maximum(0, _wave(times, 6)), times),
        "upperleg01.R": _about("x", -14 * np.maximum(0, _wave(times, 6, 0.5)), times),
        "lowerleg01.L": _about("x", 30 * np.maximum(0, _wave(times, 6)), times),
        "lowerleg01.R": _about("x", 30 * np.maximum(0, _wave(times, 6, 0.5)), times),
        "neck02": _about("z", 12 * _wave(times, 3), times),
    }
    return _motion(times, 3 * 360 * times, joints)


MOTIONS: dict[str, Callable[[Times], Motion]] = {
    "turn": turn,
    "walk_circle": walk_circle,
    "dance": dance,
    "fast_spin": fast_spin,
    "still": still,
}
