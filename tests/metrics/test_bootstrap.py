from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.bootstrap import mean_interval


def test_the_interval_of_many_draws_is_that_of_the_normal_law():
    values = np.random.default_rng(3).normal(5.0, 2.0, 400)
    low, high = mean_interval(values)
    half = 1.96 * values.std() / np.sqrt(len(values))
    assert (low, high) == pytest.approx(
        (values.mean() - half, values.mean() + half), abs=0.15 * half
    )


def test_the_same_seed_gives_the_same_interval():
    values = [0.0, 1.0, 1.0, 0.0, 1.0]
    assert mean_interval(values, 1) == mean_interval(values, 1)
    assert 0.0 <= mean_interval(values).low < 0.6 < mean_interval(values).high <= 1.0


def test_equal_views_leave_no_doubt_and_one_view_no_interval():
    assert mean_interval([0.7] * 5) == (0.7, 0.7)
    assert np.isnan(mean_interval([0.7])).all()
