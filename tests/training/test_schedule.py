from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.training.pace import Pace
from mocoflow_core.training.schedule import ScheduleConfig, band_alpha, rate_factor


def shares(steps: int) -> list[float]:
    return [Pace(steps).share(step, 0.0) for step in range(steps)]


def test_the_rate_falls_evenly_from_one_to_its_last_share():
    factors = [rate_factor(share, 0.1) for share in shares(200)]
    assert factors[0] == 1.0
    assert factors[-1] == pytest.approx(0.1)
    ratios = np.divide(factors[1:], factors[:-1])
    assert ratios == pytest.approx(ratios[0])
    assert ratios[0] < 1


@pytest.mark.parametrize("steps", [1, 2])
def test_the_shortest_schedules_have_rates(steps):
    assert rate_factor(shares(steps)[0], 0.1) == 1.0
    assert np.isfinite(band_alpha(shares(steps)[0], 0.5, 8))


def test_bands_fade_in_over_the_coarse_part_and_then_stay():
    alphas = [band_alpha(share, 2 / 3, 8) for share in shares(301)]
    assert alphas[0] == 0.0
    assert alphas[100] == pytest.approx(4.0)
    assert alphas[200:] == pytest.approx([8.0] * 101)
    assert (np.diff(alphas) >= 0).all()
    assert np.diff(alphas).max() == pytest.approx(8 / 200)


def test_without_a_coarse_part_all_bands_are_on_from_the_start():
    assert band_alpha(0.0, 0.0, 8) == 8.0


def test_shortening_the_schedule_keeps_its_shape():
    long = [band_alpha(share, 0.6, 6) for share in shares(1001)[::10]]
    short = [band_alpha(share, 0.6, 6) for share in shares(101)]
    assert short == pytest.approx(long)


def test_the_joint_steps_are_the_coarse_and_the_fine_ones():
    schedule = ScheduleConfig(coarse_steps=7, fine_steps=5)
    assert schedule.joint_steps == 12
    assert schedule.coarse_share == pytest.approx(7 / 12)


STAGES = ScheduleConfig(pretrain_steps=10, fit_steps=20, coarse_steps=50, fine_steps=30)


def test_each_stage_makes_its_own_steps():
    assert STAGES.pretraining().joint_steps == 10
    assert STAGES.fitting().joint_steps == 20
    assert STAGES.joint().joint_steps == 80
    assert STAGES.pretraining().without_steps().joint_steps == 0


def test_the_scale_shrinks_all_stages_in_proportion():
    tenth = STAGES.model_copy(update={"scale": 0.1})
    assert tenth.pretraining().joint_steps == 1
    assert tenth.fitting().joint_steps == 2
    assert (tenth.joint().coarse_steps, tenth.joint().fine_steps) == (5, 3)


def test_rates_decay_through_the_second_and_third_stage_as_through_one():
    fitting, joint = STAGES.fitting(), STAGES.joint()
    end = fitting.rate_networks * rate_factor(1.0, fitting.final_rate)
    assert joint.rate_networks == pytest.approx(end)
    assert joint.rate_networks * joint.final_rate == pytest.approx(STAGES.rate_networks * 0.1)
    assert end == pytest.approx(STAGES.rate_networks * 0.1**0.2)


def test_no_band_is_on_before_the_joint_stage_and_all_are_without_coarse_to_fine():
    def bands(schedule: ScheduleConfig, share: float) -> float:
        limits = (schedule.first_bands, schedule.last_bands)
        return band_alpha(share, schedule.coarse_share, 8, *limits)

    for stage in (STAGES.pretraining(), STAGES.fitting()):
        assert bands(stage, 0.0) == bands(stage, 1.0) == 0.0
    assert bands(STAGES.joint(), 0.0) == 0.0
    assert bands(STAGES.joint(), 1.0) == 8.0
    sharp = STAGES.model_copy(update={"first_bands": 1.0})
    for stage in (sharp.pretraining(), sharp.fitting(), sharp.joint()):
        assert bands(stage, 0.0) == bands(stage, 1.0) == 8.0


def test_a_schedule_of_the_fast_representation_is_its_own_joint_stage():
    assert ScheduleConfig().joint() == ScheduleConfig()
