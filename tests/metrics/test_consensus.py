from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.consensus import consensus_global_mm, consensus_local_mm

POINTS = np.random.default_rng(0).normal(size=(40, 3))
VELOCITY = np.array([0.1, 0.0, -0.2])
OFFSET = np.array([0.003, 0.004, 0.0])


def to_canonical(points: np.ndarray, frame: int) -> np.ndarray:
    return points - frame * VELOCITY


def to_observed(points: np.ndarray, frame: int) -> np.ndarray:
    return points + frame * VELOCITY


def test_exact_inverses_agree_locally_and_globally() -> None:
    assert consensus_local_mm(POINTS, 3, to_canonical, to_observed) == pytest.approx(0, abs=1e-9)
    residual = consensus_global_mm(POINTS, 3, 8, to_canonical, to_observed)
    assert residual == pytest.approx(0, abs=1e-9)


def test_an_offset_of_one_direction_counts_once_locally_and_twice_globally() -> None:
    def offset(points: np.ndarray, frame: int) -> np.ndarray:
        return to_observed(points, frame) + OFFSET

    assert consensus_local_mm(POINTS, 3, to_canonical, offset) == pytest.approx(5.0)
    assert consensus_global_mm(POINTS, 3, 8, to_canonical, offset) == pytest.approx(10.0)


def test_no_points_is_an_error_and_never_a_perfect_score() -> None:
    with pytest.raises(InputError, match="none"):
        consensus_local_mm(POINTS[:0], 3, to_canonical, to_observed)
