from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.seed_band import last_points, seed_band


def run(seconds, errors, metric="keypoint_mm"):
    """A curve whose value is its error."""
    return [
        CurveRow("turn", "mocoflow", 0, "optimise_scene", 1, t, t, metric, e)
        for t, e in zip(seconds, errors, strict=True)
    ]


def test_one_seed_is_drawn_where_it_was_measured():
    band = seed_band([run([1, 3, 9], [8, 4, 2])], "keypoint_mm")
    np.testing.assert_allclose(band.seconds, [1, 3, 9])
    for line in (band.median, band.low, band.high):
        np.testing.assert_allclose(line, [8, 4, 2])


def test_nothing_is_said_of_moments_that_a_seed_does_not_have():
    band = seed_band([run([1, 4, 16], [9, 3, 1]), run([2, 8], [6, 2])], "keypoint_mm")
    assert (band.seconds[0], band.seconds[-1]) == pytest.approx((2, 8))


def test_power_laws_measured_at_different_moments_are_compared_exactly():
    # Straight lines in log error over log seconds, so that interpolation makes no error.
    scales = (1.0, 2.0, 5.0)
    moments = ([1, 10, 100], [2, 30, 90], [1.5, 7, 150])
    runs = [run(t, s / np.sqrt(t)) for s, t in zip(scales, map(np.array, moments), strict=True)]
    band = seed_band(runs, "keypoint_mm")
    for line, scale in ((band.low, 1.0), (band.median, 2.0), (band.high, 5.0)):
        np.testing.assert_allclose(line, scale / np.sqrt(band.seconds))


def test_seeds_that_share_no_moment_have_no_band_but_their_ends():
    runs = [run([1, 2], [9, 8]), run([3, 4], [7, 6])]
    assert seed_band(runs, "keypoint_mm") is None
    np.testing.assert_allclose(last_points(runs, "keypoint_mm"), [[2, 8], [4, 6]])


def test_the_median_lies_in_the_range_whatever_the_order_of_seeds():
    generator = np.random.default_rng(0)
    runs = [run(np.sort(generator.uniform(1, 60, 8)), generator.uniform(1, 9, 8)) for _ in range(5)]
    band, turned = (seed_band(order, "keypoint_mm") for order in (runs, runs[::-1]))
    assert np.all((band.low <= band.median) & (band.median <= band.high))
    np.testing.assert_array_equal(band.median, turned.median)


def test_perfect_scores_and_metrics_that_are_absent_break_nothing():
    band = seed_band([run([0, 2], [1.0, 1.0], "ssim")], "ssim")
    assert np.isfinite(np.log(band)).all()
    assert seed_band([run([1], [1])], "psnr") is None
    assert len(last_points([], "psnr")) == 0
