"""Laws of the path that wrong positions do not move."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.body.robust_path import robust_path

TIMES = np.arange(60) / 12
SURE = np.ones(60)
NOISE = np.array([0.005, 0.03])


def curve():
    return np.stack([np.sin(TIMES), 3 + 0.3 * np.cos(2 * TIMES)], axis=-1)


def robust(positions, confidence=SURE):
    return robust_path(positions, confidence, NOISE, 4.0, 1 / 12)


@pytest.mark.parametrize("seed", range(5))
def test_positions_that_are_wrong_altogether_leave_no_trace(seed):
    random = np.random.default_rng(seed)
    noisy = curve() + NOISE * random.normal(size=(60, 2))
    wrong = random.permutation(60)[:12]
    spoilt = noisy.copy()
    spoilt[wrong] += random.normal(0, [0.5, 1.5], (12, 2))
    spoilt[wrong[:4]] = [3.0, 7.0]
    path, kept = robust(spoilt)
    assert (np.abs(path - curve()) < 4 * NOISE).all()
    far = (np.abs(spoilt - curve()) > 20 * NOISE).any(axis=1)
    assert kept[far].max() < 0.02
    right = np.setdiff1d(np.arange(60), wrong)
    assert np.median(kept[right]) > 0.8


def test_a_run_of_wrong_positions_that_agree_with_each_other_leaves_no_trace():
    spoilt = curve()
    spoilt[20:26, 1] += 1.0
    path, kept = robust(spoilt)
    assert np.abs(path - curve()).max() < 0.06
    assert kept[20:26].max() < 0.02


def test_a_leap_is_followed():
    """Half a second in the air, as gravity has it."""
    positions = np.tile([0.0, 3.0], (60, 1))
    air = np.clip(1 - ((TIMES - 2.5) / 0.3) ** 2, 0, None)
    positions[:, 0] = 0.4 * air
    path, kept = robust(positions + NOISE * np.random.default_rng(0).normal(size=(60, 2)))
    assert np.abs(path - positions)[:, 0].max() < 0.06
    assert kept[air > 0].min() > 0.3


def test_noise_that_all_positions_share_is_not_wrong():
    noisy = curve() + 6 * NOISE * np.random.default_rng(3).normal(size=(60, 2))
    assert np.median(robust(noisy)[1]) > 0.8


def test_what_is_hardly_trusted_may_lie_farther_off():
    positions = curve()
    positions[30, 1] += 0.3
    doubtful = SURE.copy()
    doubtful[30] = 0.01
    assert robust(positions)[1][30] < 0.1
    assert robust(positions, doubtful)[1][30] > 0.8


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_shortest_clips_have_a_robust_path_too(count):
    path, kept = robust(np.ones((count, 2)), np.ones(count))
    assert np.allclose(path, 1)
    assert (kept == 1).all()
