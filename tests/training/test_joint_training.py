"""Two ranks take the way of one, whatever happens on it."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from mocoflow_core.errors import InputError
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.snapshots import read_snapshots
from tests.joint_training import digest, killed_alone, killed_here, parameters, train_here
from tests.toy_training import SCHEDULE, train


def assert_near(found: Path, expected: Path, start: dict[str, torch.Tensor]) -> None:
    """Both runs went the same way: apart by rounding only, measured by the way that was gone."""
    ours, theirs = parameters(found), parameters(expected)
    for name, value in theirs.items():
        gone, apart = (value - start[name]).norm(), (ours[name] - value).norm()
        assert apart <= 1e-3 * gone, (name, float(apart), float(gone))


@pytest.fixture(scope="module")
def joint(two_ranks, toy_folder, tmp_path_factory):
    """The same run of two ranks, and what each gave back."""
    folder = tmp_path_factory.mktemp("joint") / "run"
    return folder, two_ranks(train_here, toy_folder, folder)


def test_all_ranks_end_with_the_same_weights_and_result(joint):
    folder, (first, second) = joint
    assert first == second
    assert digest(parameters(folder)) == first[1]


def test_two_ranks_end_where_one_process_ends_after_as_many_steps(prepared, alone, joint):
    (one, expected), (two, ((found, _), _)) = alone, joint
    assert found["steps"] == expected.steps == SCHEDULE.joint_steps
    assert found["rays"] == expected.rays == SCHEDULE.rays
    assert found["losses"] == pytest.approx(expected.losses, rel=1e-3)
    assert found["train_psnr"] == pytest.approx(expected.train_psnr, abs=0.01)
    assert_near(two, one, prepared.field().state_dict())


def test_only_the_first_rank_writes(joint):
    folder, _ = joint
    assert len(read_snapshots(folder)) >= 1
    assert not folder.with_name("second").exists()


def test_the_first_rank_s_clock_decides_for_all(two_ranks, toy_folder, tmp_path):
    # 50 ms a step on the first rank; the second one, asked alone, would stop after three steps.
    schedule = SCHEDULE.model_copy(update={"coarse_steps": 1000, "budget_s": 2.0})
    first, second = two_ranks(train_here, toy_folder, tmp_path / "run", schedule, (0.05, 0.5))
    assert first == second
    assert 25 < first[0]["steps"] <= 40
    assert first[0]["wall_s"] == pytest.approx(2.0, abs=0.1)
    # CPU seconds of both, twice their walls.
    assert first[0]["cpu_s"] == pytest.approx(2.0 * 11.0 * first[0]["wall_s"], rel=0.05)


def test_a_score_that_the_first_rank_sees_reached_stops_all(two_ranks, toy_folder, joint, tmp_path):
    target = joint[1][0][0]["train_psnr"] - 1.0
    schedule = SCHEDULE.model_copy(update={"until_train_psnr": target, "until_every": 5})
    first, second = two_ranks(train_here, toy_folder, tmp_path / "run", schedule)
    assert first == second
    assert first[0]["steps"] < SCHEDULE.joint_steps


@pytest.mark.parametrize("rank", [0, 1])
def test_what_one_rank_meets_all_refuse_and_stop_in_words(two_ranks, toy_folder, tmp_path, rank):
    with pytest.raises(TrainingDiverged, match="loss photometric is nan"):
        two_ranks(train_here, toy_folder, tmp_path / "run", SCHEDULE, None, rank)
    assert not (tmp_path / "run" / "model.safetensors").exists()


def test_a_checkpoint_of_two_ranks_is_gone_on_from_by_two(two_ranks, toy_folder, joint, tmp_path):
    two_ranks(killed_here, toy_folder, tmp_path / "run")
    (result, weights), _ = two_ranks(train_here, toy_folder, tmp_path / "run")
    assert result["tries"] == 2
    assert weights == joint[1][0][1]


def test_a_checkpoint_of_two_ranks_is_gone_on_from_by_one(
    two_ranks, prepared, toy_folder, alone, tmp_path
):
    two_ranks(killed_here, toy_folder, tmp_path / "run")
    assert train(prepared, tmp_path / "run").tries == 2
    assert_near(tmp_path / "run", alone[0], prepared.field().state_dict())


def test_a_checkpoint_of_one_is_gone_on_from_by_two(
    two_ranks, prepared, toy_folder, alone, tmp_path
):
    killed_alone(prepared, tmp_path / "run")
    # Only the first rank sees the folder.
    (result, _), second = two_ranks(train_here, toy_folder, tmp_path / "run")
    assert result["tries"] == second[0]["tries"] == 2
    assert_near(tmp_path / "run", alone[0], prepared.field().state_dict())


def test_a_checkpoint_of_other_settings_is_refused_by_all(
    two_ranks, prepared, toy_folder, tmp_path
):
    killed_alone(prepared, tmp_path / "run")
    before = sorted((tmp_path / "run").iterdir())
    with pytest.raises(InputError, match=r"schedule\.rays = 48, got a run with 50"):
        two_ranks(
            train_here, toy_folder, tmp_path / "run", SCHEDULE.model_copy(update={"rays": 50})
        )
    assert sorted((tmp_path / "run").iterdir()) == before
