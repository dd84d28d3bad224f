from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from mocoflow_core.errors import InputError
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training import loop
from mocoflow_core.training.checkpoint import read_metadata
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.optimise_scene import Learned
from tests.toy_training import SCHEDULE, Prepared, train

CAREFUL = SCHEDULE.model_copy(update={"checkpoint_every_s": 1e-9})


class Killed(Exception):
    """What ends a run from outside."""


def killed_at(step: int, seen=lambda: None):
    def progress(fraction: float, what: str) -> None:
        seen()
        if round(fraction * SCHEDULE.joint_steps) >= step:
            raise Killed

    return progress


def parameters(folder: Path) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


def assert_same(first: Path, second: Path) -> None:
    ours, theirs = parameters(first), parameters(second)
    assert ours.keys() == theirs.keys()
    different = [name for name in ours if not torch.equal(ours[name], theirs[name])]
    assert different == []


def test_one_seed_and_one_thread_give_identical_parameters(prepared, trained, tmp_path):
    train(prepared, tmp_path)
    assert_same(trained, tmp_path)


def test_another_seed_gives_other_parameters(prepared, trained, tmp_path):
    train(prepared, tmp_path, seed=1)
    ours, theirs = parameters(trained), parameters(tmp_path)
    assert not torch.equal(ours["canonical.tables.0"], theirs["canonical.tables.0"])


def test_the_caller_s_random_state_does_not_matter(prepared, trained, tmp_path):
    torch.manual_seed(987)
    torch.rand(11)
    train(prepared, tmp_path)
    assert_same(trained, tmp_path)


@pytest.mark.parametrize("step", [10, 20])
def test_a_killed_run_ends_in_the_parameters_of_an_undisturbed_one(
    prepared, trained, tmp_path, step
):
    with pytest.raises(Killed):
        train(prepared, tmp_path, schedule=CAREFUL, progress=killed_at(step))
    assert not (tmp_path / "model.safetensors").exists()
    assert not (tmp_path / "result.json").exists()
    result = train(prepared, tmp_path, schedule=CAREFUL)
    assert result.tries == 2
    assert result.steps == SCHEDULE.joint_steps
    assert_same(trained, tmp_path)


def test_work_after_the_last_checkpoint_is_done_again_to_the_same_end(prepared, trained, tmp_path):
    kept = tmp_path.with_name(tmp_path.name + "_kept")

    def keep_the_first():
        if not kept.exists():
            shutil.copytree(tmp_path, kept)

    with pytest.raises(Killed):
        train(prepared, tmp_path, schedule=CAREFUL, progress=killed_at(20, keep_the_first))
    for name in kept.glob("checkpoint*"):
        shutil.copy(name, tmp_path)
    train(prepared, tmp_path, schedule=CAREFUL)
    assert_same(trained, tmp_path)


def test_threads_and_steps_of_a_resumed_run_come_from_its_first_start(prepared, trained, tmp_path):
    with pytest.raises(Killed):
        train(prepared, tmp_path, schedule=CAREFUL, progress=killed_at(10))
    other = CAREFUL.model_copy(update={"threads": 2})
    result = train(prepared, tmp_path, schedule=other)
    assert result.threads == 1
    assert_same(trained, tmp_path)


def test_the_thread_count_of_the_caller_comes_back(prepared, tmp_path):
    with pytest.raises(Killed):
        train(prepared, tmp_path, progress=killed_at(10))
    assert torch.get_num_threads() == 1


def test_a_finished_run_leaves_no_checkpoint(trained):
    assert not list(trained.glob("checkpoint*"))


def test_training_fits_the_pixels_better_than_its_start(prepared, trained, tmp_path):
    start = SCHEDULE.model_copy(update={"coarse_steps": 1, "fine_steps": 0})
    before = train(prepared, tmp_path, schedule=start).losses["photometric"]
    after = json.loads((trained / "result.json").read_text())["losses"]["photometric"]
    assert after < 0.8 * before


def test_held_out_frames_do_not_reach_the_parameters(prepared, trained, tmp_path):
    clip = prepared.clip
    rng = np.random.default_rng(0)
    frames, masks = clip.frames.copy(), clip.masks.copy()
    frames[clip.held_out] = rng.integers(0, 256, frames[clip.held_out].shape)
    masks[clip.held_out] = rng.random(masks[clip.held_out].shape) > 0.5
    assert clip.held_out.sum() == 2
    train(replace(prepared, clip=replace(clip, frames=frames, masks=masks)), tmp_path)
    assert_same(trained, tmp_path)


def test_a_budget_shortens_the_schedule(prepared, tmp_path):
    long = SCHEDULE.model_copy(
        update={"coarse_steps": 60_000, "fine_steps": 40_000, "budget_s": 2.0}
    )
    result = train(prepared, tmp_path, schedule=long)
    assert 1 < result.steps < 2000
    assert (tmp_path / "model.safetensors").exists()


def test_a_generous_budget_changes_nothing(prepared, trained, tmp_path):
    train(prepared, tmp_path, schedule=SCHEDULE.model_copy(update={"budget_s": 1e6}))
    assert_same(trained, tmp_path)


def test_what_is_not_needed_is_not_learned(prepared, tmp_path):
    learned = Learned(motion_residual=False, consensus=False, appearance_codes=False)
    result = train(prepared, tmp_path, learned=learned)
    start = prepared.field(seed=0).state_dict()
    end = parameters(tmp_path)
    for name, value in start.items():
        if name == "appearance" or (name.startswith("motion.") and "encoding" not in name):
            assert torch.equal(end[name], value), name
    assert not torch.equal(end["canonical.tables.0"], start["canonical.tables.0"])
    assert "consensus" not in result.losses
    assert "appearance" not in result.losses


def test_a_weight_of_zero_leaves_its_loss_out(prepared, tmp_path):
    result = train(prepared, tmp_path, losses=LossConfig(consensus_weight=0.0))
    assert "consensus" not in result.losses


def test_snapshots_are_indexed_and_the_last_is_the_trained_scene(trained):
    entries = json.loads((trained / "snapshots" / "snapshots.json").read_text())
    assert entries[-1]["step"] == SCHEDULE.joint_steps
    last = load_file(trained / "snapshots" / f"{SCHEDULE.joint_steps:06d}.safetensors")
    model = parameters(trained)
    assert all(torch.equal(last[name], model[name]) for name in model)


def with_rate(rate: float):
    rates = ("rate_features", "rate_networks", "rate_motion")
    return SCHEDULE.model_copy(update=dict.fromkeys(rates, rate))


@pytest.mark.parametrize("rate", [1.0, 1e8])
def test_rates_far_too_high_end_in_a_finite_scene(prepared, tmp_path, rate):
    train(prepared, tmp_path, schedule=with_rate(rate))
    assert all(torch.isfinite(value).all() for value in parameters(tmp_path).values())


def test_a_loss_that_is_never_finite_ends_in_words_and_leaves_no_scene(prepared, tmp_path):
    with pytest.raises(TrainingDiverged, match=r"loss silhouette"):
        train(prepared, tmp_path, losses=LossConfig(silhouette_weight=1e300))
    assert not (tmp_path / "model.safetensors").exists()
    assert not (tmp_path / "result.json").exists()


@pytest.mark.parametrize("value", [0, 255])
def test_a_black_or_white_frame_and_no_person_in_any_mask_stay_finite(prepared, tmp_path, value):
    clip = prepared.clip
    frames = clip.frames.copy()
    frames[0] = value
    strange = replace(clip, frames=frames, masks=np.zeros_like(clip.masks))
    result = train(replace(prepared, clip=strange), tmp_path)
    assert result.events == []
    assert all(torch.isfinite(tensor).all() for tensor in parameters(tmp_path).values())


def test_one_ray_per_step_is_enough_to_run(prepared, tmp_path):
    train(prepared, tmp_path, schedule=SCHEDULE.model_copy(update={"rays": 1}))
    assert all(torch.isfinite(tensor).all() for tensor in parameters(tmp_path).values())


def test_a_plant_in_a_checkpoint_is_refused_in_words(prepared: Prepared, tmp_path):
    with pytest.raises(Killed):
        train(prepared, tmp_path, schedule=CAREFUL, progress=killed_at(10))
    (file,) = tmp_path.glob("checkpoint*")
    tensors, metadata = load_file(file), read_metadata(file)
    tensors["model.canonical.tables.0"][0, 0] = torch.nan
    save_file(tensors, file, metadata=metadata)
    with pytest.raises(TrainingDiverged, match=r"canonical\.tables\.0"):
        train(prepared, tmp_path, schedule=CAREFUL)


def test_weights_that_the_very_last_update_spoils_are_not_kept(prepared, tmp_path, monkeypatch):
    made = loop._optimiser

    def spoiling(field, schedule):
        optimiser = made(field, schedule)
        update, steps = optimiser.step, iter(range(1, 1000))

        def step():
            update()
            if next(steps) == SCHEDULE.joint_steps:
                with torch.no_grad():
                    field.canonical.tables[0][0, 0] = torch.nan

        optimiser.step = step
        return optimiser

    monkeypatch.setattr(loop, "_optimiser", spoiling)
    result = train(prepared, tmp_path)
    assert all(torch.isfinite(value).all() for value in parameters(tmp_path).values())
    assert [event["step"] for event in result.events] == [SCHEDULE.joint_steps]


def test_rates_that_lead_astray_are_an_event(prepared, tmp_path):
    assert train(prepared, tmp_path, schedule=with_rate(0.5)).events


def test_a_body_that_no_frame_shows_is_bad_input(prepared, tmp_path):
    camera = prepared.clip.camera
    aside = replace(camera, t=camera.t + np.array([50.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="in sight"):
        train(replace(prepared, clip=replace(prepared.clip, camera=aside)), tmp_path)
