"""Whether a setting does better than the defaults: on every scene, by a stated amount.

The yardstick is the schedule's length, the one knob that everybody can turn: the error that more
or fewer steps of the defaults reach in the same seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from benchmarks.knobs import DEFAULT, STEPS
from benchmarks.precision_rows import Point

BETTER_DB = 0.15  # at the same time
LESS_TIME = 0.2  # at the same error
# CPU seconds of the same work differ by so much, and errors of two seeds by 0.1 dB.
SAME_TIME, SAME_ERROR_DB = 0.05, 0.05

Verdict = Literal["better", "cheaper"]


def default_of(points: Sequence[Point], scene: str) -> Point:
    """The defaults on a scene."""
    return next(p for p in points if p.scene == scene and p.knob == DEFAULT.knob)


def gain_db(point: Point, points: Sequence[Point]) -> float:
    """PSNR above what the yardstick reaches on the same scene in the same CPU seconds.

    Between two lengths of the schedule the yardstick is interpolated over log seconds; beyond its
    ends it is level, so that nothing is gained by being faster than the shortest.
    """
    knobs = (STEPS, DEFAULT.knob)
    yardstick = sorted(
        (p.cpu_s, p.psnr_union) for p in points if p.scene == point.scene and p.knob in knobs
    )
    seconds, psnr = np.array(yardstick).T
    return point.psnr_union - float(np.interp(np.log(point.cpu_s), np.log(seconds), psnr))


def verdict(point: Point, default: Point) -> Verdict | None:
    """How a setting beats the defaults on one scene; None where it does not clearly."""
    time = point.cpu_s / default.cpu_s
    gained_db = point.psnr_union - default.psnr_union
    if gained_db >= BETTER_DB and time <= 1.0 + SAME_TIME:
        return "better"
    if gained_db >= -SAME_ERROR_DB and time <= 1.0 - LESS_TIME:
        return "cheaper"
    return None


def beats_default(settings: Sequence[Point], points: Sequence[Point]) -> bool:
    """Whether one setting, given on every scene, beats the defaults on all of them."""
    return all(verdict(point, default_of(points, point.scene)) for point in settings)


def mean_gain_db(knob: str, value: str, points: Sequence[Point]) -> float:
    """The gain over the yardstick, averaged over the scenes."""
    gains = [gain_db(p, points) for p in points if (p.knob, p.value) == (knob, value)]
    return float(np.mean(gains))
