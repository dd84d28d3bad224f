"""A run ends on time with its schedule completed, however fast the machine is."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.training.pace import Pace, plan_pace, plan_rays
from mocoflow_core.training.schedule import ScheduleConfig


def ran(pace: Pace, seconds_per_step) -> tuple[list[float], float]:
    """The share of each step, and when the last one ended."""
    shares, elapsed_s, step_s = [], 0.0, 0.0
    while not pace.is_over(len(shares), elapsed_s, step_s):
        shares.append(pace.share(len(shares), elapsed_s))
        step_s = seconds_per_step(len(shares), elapsed_s)
        elapsed_s += step_s
    return shares, elapsed_s


def steady(step, elapsed_s):
    return 0.05


def slower_after_a_third(step, elapsed_s):
    return 0.05 if elapsed_s < 10 else 0.25


def faster_after_a_third(step, elapsed_s):
    return 0.25 if elapsed_s < 10 else 0.05


def with_a_stall(step, elapsed_s):
    return 6.0 if step == 100 else 0.05


def uneven(step, elapsed_s):
    return (0.01, 0.02, 0.3)[step % 3]


@pytest.mark.parametrize(
    "speed", [steady, slower_after_a_third, faster_after_a_third, with_a_stall, uneven]
)
def test_a_budget_is_kept_at_any_speed_and_the_schedule_completes(speed):
    shares, ended_s = ran(Pace(100_000, 30.0), speed)
    # Half of the longest usual step: nobody can stop a step half-way.
    assert abs(ended_s - 30.0) <= 0.15
    assert shares[0] == 0.0
    assert (np.diff(shares) > 0).all()
    assert shares[-1] > 0.98


def test_without_a_budget_the_clock_does_not_matter():
    shares, _ = ran(Pace(50), steady)
    assert shares == ran(Pace(50), with_a_stall)[0]
    assert shares == pytest.approx(np.linspace(0, 1, 50))


def test_a_generous_budget_ends_with_the_longest_schedule():
    shares, ended_s = ran(Pace(50, 1e6), steady)
    assert len(shares) == 50
    assert shares[-1] == 1.0
    assert ended_s == pytest.approx(50 * 0.05)


def test_a_budget_that_is_used_up_leaves_no_step():
    assert ran(Pace(50, 0.0), steady) == ([], 0.0)


def test_the_preparation_counts_in_the_budget():
    schedule = ScheduleConfig(coarse_steps=60, fine_steps=40, budget_s=30.0, longest=1.5)
    assert plan_pace(schedule, 12.0, 0.5) == Pace(150, 18.0, 0.5)
    assert plan_pace(schedule, 40.0, 0.5) == Pace(150, 0.0, 0.5)
    assert plan_pace(schedule.model_copy(update={"budget_s": None}), 12.0, 0.5) == Pace(100)


def test_getting_ready_takes_nothing_from_the_schedule_but_time():
    pace = Pace(100_000, 18.0, 3.0)
    assert pace.share(0, 3.0) == 0.0
    assert pace.share(1, 10.5) == pytest.approx(0.5)
    assert pace.share(2, 18.0) == 1.0


def test_fewer_rays_where_a_budget_leaves_few_steps():
    schedule = ScheduleConfig(rays=768, fewest_steps=300, fewest_rays=192)
    assert plan_rays(schedule, 30.0, 0.02) == 768
    assert plan_rays(schedule, 3.0, 0.02) == 384
    assert plan_rays(schedule, -1.0, 0.02) == 192


def test_a_step_never_gets_more_rays_than_the_schedule_says():
    schedule = ScheduleConfig(rays=64, fewest_rays=192)
    assert plan_rays(schedule, 0.1, 0.02) == 64
