from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from mocoflow_core.errors import InputError
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.training import loop
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.problem import Learned
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import read_snapshots, snapshot_weights
from tests.toy_training import SCHEDULE, Prepared, train
from tests.training.slow_clock import SlowClock

CAREFUL = SCHEDULE.model_copy(update={"checkpoint_every_s": 1e-9})


class Killed(Exception):
    """What ends a run from outside."""


def killed_at(step: float, seen=lambda: None):
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


# So high a rate leaves every minimum: the guard goes back at step 50.
WILD = CAREFUL.model_copy(
    update={
        "checkpoint_every_s": 0.1,
        "coarse_steps": 60,
        "fine_steps": 40,
        "rate_features": 0.5,
        "rate_networks": 0.5,
        "rate_motion": 0.5,
    }
)


@pytest.fixture(scope="module")
def went_back(prepared, tmp_path_factory):
    folder = tmp_path_factory.mktemp("went_back")
    return folder, train(prepared, folder, schedule=WILD)


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_a_run_that_went_back_ends_the_same_when_killed_before_or_after(
    prepared, went_back, tmp_path, share
):
    folder, undisturbed = went_back
    assert any(event["step"] == 50 for event in undisturbed.events)
    with pytest.raises(Killed):
        train(prepared, tmp_path, schedule=WILD, progress=killed_at(share * SCHEDULE.joint_steps))
    resumed = train(prepared, tmp_path, schedule=WILD)
    assert resumed.events == undisturbed.events
    assert resumed.losses == pytest.approx(undisturbed.losses)
    assert_same(folder, tmp_path)


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


LONG = SCHEDULE.model_copy(update={"coarse_steps": 60_000, "fine_steps": 40_000})


def with_budget(seconds: float, schedule: ScheduleConfig = LONG) -> ScheduleConfig:
    return schedule.model_copy(update={"budget_s": seconds})


def test_a_budget_ends_on_time_with_the_preparation_on_the_clock(prepared, tmp_path):
    # Each look at this clock costs 50 ms, and each step looks once: some 60 steps in 3 s.
    clock = TrainingClock(now=SlowClock(per_look=0.05))
    result = train(prepared, tmp_path, schedule=with_budget(5.0), before=Seconds(2.0), clock=clock)
    assert result.wall_s == pytest.approx(3.0, abs=0.15)
    assert 40 < result.steps <= 60
    assert (tmp_path / "model.safetensors").exists()
    assert result.warnings == ()


def test_a_budget_holds_when_the_machine_gets_slower_on_the_way(prepared, tmp_path):
    machine = SlowClock(per_look=0.04)

    def slower(fraction: float, text: str) -> None:
        machine.per_look = 0.04 if fraction < 0.5 else 0.2

    result = train(
        prepared,
        tmp_path,
        schedule=with_budget(4.0),
        progress=slower,
        clock=TrainingClock(now=machine),
    )
    assert result.wall_s == pytest.approx(4.0, abs=0.2)
    # Both halves of the time are used: some 50 steps and 10.
    assert 45 < result.steps < 70


@pytest.mark.parametrize("jump_s", [-1e6, 1e6])
def test_a_clock_that_jumps_ends_in_a_scene_with_a_curve_that_only_grows(
    prepared, tmp_path, jump_s
):
    """Put back, the time so far is kept; put forward, the budget is over and the scene whole."""
    machine = SlowClock(per_look=0.05)
    jumps = [jump_s]

    def jump(fraction: float, text: str) -> None:
        if fraction > 0.4 and jumps:
            machine.spend(jumps.pop())

    clock = TrainingClock(now=machine)
    result = train(
        prepared, tmp_path, schedule=with_budget(3.0), progress=jump, clock=clock, watch=unwatched
    )
    assert not jumps
    assert (45 < result.steps < 75) if jump_s < 0 else (15 < result.steps < 45)
    assert (result.wall_s < 3.5) if jump_s < 0 else (result.wall_s > 1e6)
    seconds = [snapshot.wall_s for snapshot in read_snapshots(tmp_path)]
    assert seconds == sorted(seconds)
    assert seconds[0] >= 0
    assert all(torch.isfinite(value).all() for value in parameters(tmp_path).values())


def unwatched(curve) -> None:
    """Snapshots are kept, and shown to nobody."""


def test_a_killed_run_with_a_budget_still_ends_on_time(prepared, tmp_path):
    schedule = with_budget(3.0).model_copy(update={"checkpoint_every_s": 0.5})

    def killed(fraction: float, text: str) -> None:
        if fraction > 0.5:
            raise Killed

    with pytest.raises(Killed):
        clock = TrainingClock(now=SlowClock(per_look=0.05))
        train(prepared, tmp_path, schedule=schedule, progress=killed, clock=clock)
    clock = TrainingClock(now=SlowClock(per_look=0.05))
    result = train(prepared, tmp_path, schedule=schedule, clock=clock)
    assert result.tries == 2
    assert result.wall_s == pytest.approx(3.0, abs=0.15)


def test_a_budget_below_the_preparation_leaves_the_start_scene_and_says_so(prepared, tmp_path):
    result = train(prepared, tmp_path, schedule=with_budget(5.0), before=Seconds(12.0))
    assert result.steps == 0
    start = prepared.field(seed=0).state_dict()
    assert all(torch.equal(start[name], value) for name, value in parameters(tmp_path).items())
    assert "untrained" in result.warnings[0]
    took_s = float(re.search(r"took ([\d.]+) s", result.warnings[0])[1])
    assert 12.0 <= took_s < 60.0  # and the stage's own start, on however busy a machine
    assert len(read_snapshots(tmp_path)) == 1
    opened = TrainedScene.open(tmp_path)
    rgb, opacity = opened.render(prepared.clip.camera, 0.5)
    assert np.isfinite(rgb).all()
    assert opacity.max() > 0.5


def test_a_generous_budget_makes_the_longest_schedule(prepared, trained, tmp_path):
    whole = with_budget(1e6, SCHEDULE).model_copy(update={"longest": 1.0})
    train(prepared, tmp_path, schedule=whole)
    assert_same(trained, tmp_path)
    longer = whole.model_copy(update={"longest": 1.6})
    assert train(prepared, tmp_path / "longer", schedule=longer).steps == 40


def until(decibels: float, **changes) -> ScheduleConfig:
    update = {"until_train_psnr": decibels, "until_every": 5, **changes}
    return SCHEDULE.model_copy(update=update)


def test_a_run_stops_at_the_first_look_at_which_the_score_is_reached(prepared, trained, tmp_path):
    target = read_snapshots(trained)[-1].train_psnr - 1.0
    result = train(prepared, tmp_path, schedule=until(target))
    assert result.steps < SCHEDULE.joint_steps
    assert result.steps % 5 == 0
    assert result.train_psnr >= target
    assert result.warnings == ()


def test_a_score_that_is_not_reached_ends_with_the_schedule_and_says_so(prepared, tmp_path):
    result = train(prepared, tmp_path, schedule=until(98.0))
    assert result.steps == SCHEDULE.joint_steps
    assert "not 98, at the end" in result.warnings[0]


def test_a_killed_run_stops_at_the_step_of_an_undisturbed_one(prepared, tmp_path):
    schedule = until(18.0, coarse_steps=100, checkpoint_every_s=1e-9)
    undisturbed = train(prepared, tmp_path / "undisturbed", schedule=schedule)
    assert 10 < undisturbed.steps < 110

    def killed(fraction: float, text: str) -> None:
        raise Killed

    with pytest.raises(Killed):
        train(prepared, tmp_path / "killed", schedule=schedule, progress=killed)
    assert train(prepared, tmp_path / "killed", schedule=schedule).steps == undisturbed.steps
    assert_same(tmp_path / "killed", tmp_path / "undisturbed")


def test_looking_at_the_score_changes_no_parameter_and_costs_no_training_time(
    prepared, trained, tmp_path
):
    machine, pauses = SlowClock(), []

    def looked(curve) -> None:
        machine.spend(1000.0)

    clock = TrainingClock(lambda wall_s, cpu_s: pauses.append(wall_s), machine)
    result = train(prepared, tmp_path, schedule=until(98.0), watch=looked, clock=clock)
    assert_same(trained, tmp_path)
    assert result.wall_s == 0.0
    assert sum(pauses) == 1000.0


def test_a_score_to_reach_needs_a_mask(prepared, tmp_path):
    blind = replace(prepared.clip, masks=np.zeros_like(prepared.clip.masks))
    with pytest.raises(InputError, match="mask"):
        train(replace(prepared, clip=blind), tmp_path, schedule=until(20.0))


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
    taken = read_snapshots(trained)[-1]
    assert taken.step == SCHEDULE.joint_steps
    last = load_file(snapshot_weights(trained, taken))
    model = parameters(trained)
    assert all(torch.equal(last[name], model[name]) for name in model)


def test_the_curve_grows_with_each_snapshot(prepared, tmp_path):
    curves = []
    clock = TrainingClock(now=SlowClock(per_look=0.2))
    train(prepared, tmp_path, watch=lambda curve: curves.append(list(curve)), clock=clock)
    assert [len(curve) for curve in curves] == list(range(1, len(curves) + 1))
    assert len(curves) >= 3
    assert curves[-1] == read_snapshots(tmp_path)
    assert all(point.train_psnr > 0 for point in curves[-1])
    assert curves[-1][-1].train_psnr > curves[-1][0].train_psnr


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
    tensors = load_file(file)
    with safe_open(file, framework="pt") as opened:
        metadata = opened.metadata()
    tensors["model.canonical.tables.0"][0, 0] = torch.nan
    save_file(tensors, file, metadata=metadata)
    with pytest.raises(TrainingDiverged, match=r"canonical\.tables\.0"):
        train(prepared, tmp_path, schedule=CAREFUL)


def test_weights_that_the_very_last_update_spoils_are_not_kept(prepared, tmp_path, monkeypatch):
    made = loop.build_optimiser

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

    monkeypatch.setattr(loop, "build_optimiser", spoiling)
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
