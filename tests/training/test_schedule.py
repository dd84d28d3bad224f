from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.training.clock import Seconds, snapshot_due
from mocoflow_core.training.schedule import ScheduleConfig, band_alpha, rate_factor


def test_the_rate_falls_evenly_from_one_to_its_last_share():
    factors = [rate_factor(step, 200, 0.1) for step in range(200)]
    assert factors[0] == 1.0
    assert factors[-1] == pytest.approx(0.1)
    ratios = np.divide(factors[1:], factors[:-1])
    assert ratios == pytest.approx(ratios[0])
    assert ratios[0] < 1


@pytest.mark.parametrize("steps", [1, 2])
def test_the_shortest_schedules_have_rates(steps):
    assert rate_factor(0, steps, 0.1) == 1.0
    assert np.isfinite(band_alpha(0, steps, 0.5, 8))


def test_bands_fade_in_over_the_coarse_part_and_then_stay():
    alphas = [band_alpha(step, 300, 2 / 3, 8) for step in range(300)]
    assert alphas[0] == 0.0
    assert alphas[100] == pytest.approx(4.0)
    assert alphas[200:] == [8.0] * 100
    assert (np.diff(alphas) >= 0).all()
    assert np.diff(alphas).max() == pytest.approx(8 / 200)


def test_without_a_coarse_part_all_bands_are_on_from_the_start():
    assert band_alpha(0, 100, 0.0, 8) == 8.0


def test_shortening_the_schedule_keeps_its_shape():
    long = [band_alpha(step, 1000, 0.6, 6) for step in range(0, 1000, 10)]
    short = [band_alpha(step, 100, 0.6, 6) for step in range(100)]
    assert short == pytest.approx(long)


def test_the_joint_steps_are_the_coarse_and_the_fine_ones():
    assert ScheduleConfig(coarse_steps=7, fine_steps=5).joint_steps == 12


def test_snapshots_are_due_at_geometric_times():
    taken, at = 0, []
    for tenth in range(700):
        if snapshot_due(taken, tenth / 10, 0.0):
            taken, at = taken + 1, [*at, tenth / 10]
    assert at == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0]


def test_seconds_of_two_tries_add_up():
    total = Seconds(1.0, 3.0) + Seconds(0.5, 0.25)
    assert (total.wall, total.cpu) == (1.5, 3.25)
    assert total - Seconds(0.5, 0.25) == Seconds(1.0, 3.0)
