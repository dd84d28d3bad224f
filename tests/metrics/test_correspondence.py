from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.correspondence import carry, correspondence_mm, draw_pairs

FRAMES = np.array([3, 8, 20])
CANONICAL = np.random.default_rng(0).normal(size=(50, 3))


def pose(frame: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(frame)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return rotation, rng.normal(size=3)


def to_observed(points: np.ndarray, frame: int) -> np.ndarray:
    rotation, shift = pose(frame)
    return points @ rotation.T + shift


def to_canonical(points: np.ndarray, frame: int) -> np.ndarray:
    rotation, shift = pose(frame)
    return (points - shift) @ rotation


TRUTH = np.stack([to_observed(CANONICAL, frame) for frame in FRAMES])
PAIRS = [(3, 8), (20, 3), (8, 8)]


def test_the_true_motion_has_no_error() -> None:
    errors = correspondence_mm(TRUTH, FRAMES, PAIRS, to_canonical, to_observed)
    np.testing.assert_allclose(errors, 0.0, atol=1e-9)


def test_the_canonical_space_may_be_anything() -> None:
    matrix = np.random.default_rng(9).normal(size=(3, 3))

    def bent_canonical(points: np.ndarray, frame: int) -> np.ndarray:
        return to_canonical(points, frame) @ matrix

    def bent_observed(points: np.ndarray, frame: int) -> np.ndarray:
        return to_observed(points @ np.linalg.inv(matrix), frame)

    errors = correspondence_mm(TRUTH, FRAMES, PAIRS, bent_canonical, bent_observed)
    np.testing.assert_allclose(errors, 0.0, atol=1e-9)


def test_an_offset_in_one_frame_is_measured_in_millimetres() -> None:
    def shifted(points: np.ndarray, frame: int) -> np.ndarray:
        return to_observed(points, frame) + ([0.03, 0.04, 0.0] if frame == 8 else [0, 0, 0])

    errors = correspondence_mm(TRUTH, FRAMES, PAIRS, to_canonical, shifted)
    np.testing.assert_allclose(errors, [50.0, 0.0, 50.0], atol=1e-9)


def test_carrying_there_and_back_returns_to_the_start() -> None:
    there = carry(TRUTH[0], 3, 20, to_canonical, to_observed)
    np.testing.assert_allclose(carry(there, 20, 3, to_canonical, to_observed), TRUTH[0])


def test_a_frame_without_truth_is_refused_by_its_number() -> None:
    with pytest.raises(InputError, match=r"\[7\]"):
        correspondence_mm(TRUTH, FRAMES, [(3, 7)], to_canonical, to_observed)


def test_every_frame_is_a_target_and_never_its_own_source() -> None:
    pairs = draw_pairs(FRAMES, sources=2, seed=0)
    assert sorted(end for _, end in pairs) == [3, 3, 8, 8, 20, 20]
    assert all(start != end for start, end in pairs)
    assert pairs == draw_pairs(FRAMES, sources=2, seed=0)
