"""Laws of the smooth path."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.body.smooth_path import smooth_path

TIMES = np.arange(60) / 12
SURE = np.ones(60)


def smoothed(positions, confidence=SURE, noise=0.03, acceleration=4.0, step=1 / 12):
    return smooth_path(positions, confidence, noise, acceleration, step)


def test_steady_motion_is_left_alone():
    line = 0.3 + 1.2 * TIMES
    assert np.allclose(smoothed(line), line, atol=1e-9)


def test_noise_becomes_smaller():
    truth = np.sin(TIMES)
    noisy = truth + np.random.default_rng(0).normal(0, 0.03, 60)
    assert np.abs(smoothed(noisy) - truth).mean() < 0.7 * np.abs(noisy - truth).mean()


def test_frames_without_confidence_do_not_count():
    truth = np.sin(TIMES)
    wrong = truth.copy()
    wrong[20:23] = 100
    confidence = SURE.copy()
    confidence[20:23] = 0
    assert np.abs(smoothed(wrong, confidence) - truth).max() < 0.01


def test_less_confidence_means_less_weight():
    positions = np.zeros(60)
    positions[30] = 1
    doubtful = SURE.copy()
    doubtful[30] = 0.01
    assert smoothed(positions, doubtful)[30] < 0.05 * smoothed(positions)[30] + 0.05


def test_the_path_does_not_depend_on_how_often_the_source_is_numbered():
    """Twelve frames per second seen as every fifth of sixty give the same path."""
    positions = np.random.default_rng(1).normal(0, 0.1, 60)
    sparse, known = np.zeros(296), np.zeros(296)
    sparse[::5], known[::5] = positions, 1
    often = smoothed(sparse, known, step=1 / 60)[::5]
    assert np.abs(often - smoothed(positions)).max() < 0.02


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_shortest_clips_pass(count):
    assert np.isfinite(smoothed(np.ones(count), np.ones(count))).all()


def test_one_known_position_is_the_path():
    known = np.zeros(9)
    known[4] = 0.5
    assert np.allclose(smoothed(7.0 * (known > 0), known), 7)
