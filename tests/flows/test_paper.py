"""The whole flow with the paper's networks, tiny, on the toy scene."""

from __future__ import annotations

import json
from typing import get_args

import numpy as np
import pytest

from flows.command_line import PRESET_HELP
from mocoflow_core.errors import InputError
from mocoflow_core.metrics.curve import read_curve
from mocoflow_core.metrics.table import read_scores
from mocoflow_core.presets import PRESETS, Preset
from tests.flows.stages import STAGES

TINY = (
    "networks.radiance.layers=2",
    "networks.radiance.width=16",
    "networks.radiance.skip=0",
    "networks.motion.layers=2",
    "networks.motion.width=16",
    "networks.motion.skip=0",
    "box.coarse_samples=6",
    "box.fine_samples=6",
    "mesh_views.views=4",
    "mesh_views.side_px=16",
    "schedule.pretrain_steps=6",
    "schedule.fit_steps=6",
    "schedule.coarse_steps=6",
    "schedule.fine_steps=4",
    "schedule.rays=32",
    "schedule.threads=1",
    "presentation.turntable_views=2",
    "person_scores.views=1",
)


@pytest.fixture(scope="module")
def paper_run(reconstruct, toy_scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "paper"
    return out, reconstruct(toy_scene, out, preset="paper", settings=TINY)


def test_the_paper_s_stages_run_and_leave_what_the_fast_ones_leave(paper_run):
    out, record = paper_run
    assert [stage.name for stage in record.stages] == STAGES
    scores = read_scores(out / "scores.parquet")
    methods = {"mocoflow", "posed_mesh", "photograph", "shifted_photograph"}
    assert {row.method for row in scores} == methods
    assert all(np.isfinite(row.value) for row in scores)
    measured = {row.metric for row in scores}
    assert {"correspondence_mm", "consensus_local_mm", "psnr"} <= measured
    assert {"plausibility", "lpips_alex"} <= measured
    assert read_curve(out / "error_curve.parquet")
    for name in ("report.html", "turntable.mp4", "views/cam01/000003.png"):
        assert (out / name).stat().st_size > 0


def test_its_plan_decides_what_networks_need(paper_run):
    out, _ = paper_run
    decided = {d["name"]: d for d in json.loads((out / "plan.json").read_text())["decisions"]}
    assert {"initialisation", "adaptive_box", "motion_consensus"} <= decided.keys()
    assert not {"motion_residual", "wide_shell", "fixed_light"} & decided.keys()


def test_a_changed_joint_schedule_repeats_no_earlier_stage(
    paper_run, reconstruct, toy_scene, tmp_path
):
    longer = (*TINY, "losses.consensus_weight=0.1")
    record = reconstruct(toy_scene, tmp_path / "again", preset="paper", settings=longer)
    cached = {stage.name: stage.cached for stage in record.stages}
    assert cached["pretrain_density"]
    assert not cached["optimise_scene"]


def test_a_decision_of_the_other_representation_is_refused(reconstruct, toy_scene, tmp_path):
    settings = (*TINY, "plan.fixed_light=on")
    with pytest.raises(InputError, match="representation=networks"):
        reconstruct(toy_scene, tmp_path / "light", preset="paper", settings=settings)


def test_every_preset_is_named_in_help_and_type():
    assert tuple(PRESETS) == get_args(Preset)
    assert all(name in PRESET_HELP for name in PRESETS)


def test_the_presets_of_the_three_data_sets_have_the_paper_s_steps():
    steps = {
        name: (chosen.fit_steps, chosen.coarse_steps, chosen.fine_steps)
        for name in ("paper", "paper_aist", "paper_zju_mocap")
        for chosen in [PRESETS[name]().schedule]
    }
    assert steps == {
        "paper": (200_000, 1_500_000, 1_000_000),
        "paper_aist": (500_000, 1_500_000, 1_000_000),
        "paper_zju_mocap": (800_000, 2_000_000, 1_500_000),
    }
