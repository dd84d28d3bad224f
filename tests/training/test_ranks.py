from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from mocoflow_core.errors import InputError
from mocoflow_core.training.batches import Batch, TrainingPixels
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.objective import ShellObjective
from mocoflow_core.training.optimise_scene import optimise_scene
from mocoflow_core.training.ranks import ALONE, FirstRankFailed, Ranks, SeveralRanks
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import read_snapshots
from tests.toy_training import LOSSES, SCHEDULE, Prepared, prepare, problem_of, silent, train
from tests.training.slow_clock import SlowClock

CAREFUL = SCHEDULE.model_copy(update={"checkpoint_every_s": 1e-9})

here = cache(prepare)  # a rank prepares a scene once


class Share(Ranks):
    """A rank as the single one of a process, for what needs no other."""

    def __init__(self, rank: int, count: int) -> None:
        self.rank = rank
        self.count = count


@pytest.mark.parametrize("whole", [0, 1, 2, 7, 384])
@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_every_ray_is_one_rank_s_and_shares_are_even(whole, count):
    parts = [range(whole)[Share(rank, count).part(whole)] for rank in range(count)]
    assert [ray for part in parts for ray in part] == list(range(whole))
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_the_ranks_batches_are_the_parts_of_one(prepared):
    whole = TrainingPixels(prepared.clip, prepared.scene()).batch(
        50, 4, torch.Generator().manual_seed(0)
    )
    parts = [whole.part(Share(rank, 3).part(50)) for rank in range(3)]
    for name in ("row", "near", "far", "rgb", "mask", "background", "jitter"):
        joined = torch.cat([getattr(part, name) for part in parts])
        assert torch.equal(joined, getattr(whole, name)), name
    assert torch.equal(torch.cat([part.rays.origins for part in parts]), whole.rays.origins)
    assert {(part.rays_in_all, part.first_row) for part in parts} == {(50, int(whole.row[0]))}


def gradients(prepared: Prepared, rays: int, ranks: Ranks, empty: bool = False):
    """Joint losses and gradients of a first step, with directions that disagree."""
    field = prepared.field()
    field.anneal(2.0)
    with torch.no_grad():
        for weight in field.parameters():
            if not weight.any():
                weight.add_(0.02)
    scene = prepared.scene(field)
    pixels = TrainingPixels(prepared.clip, scene)
    generator = torch.Generator().manual_seed(0)
    batch = pixels.batch(rays, 4, generator)
    if empty:
        # The second half of all rays meets nothing.
        gone = torch.arange(rays) >= rays // 2
        batch = replace(batch, far=torch.where(gone, batch.near, batch.far))
    batch = batch.part(ranks.part(rays))
    losses_of = ranks.share(field, ShellObjective(scene, LOSSES, True, ranks))
    terms = losses_of(batch, generator)
    (torch.stack(list(terms.values())).sum() * ranks.count).backward()
    losses = {name: float(ranks.total(value.detach())) for name, value in terms.items()}
    found = {n: p.grad.numpy() for n, p in field.named_parameters() if p.grad is not None}
    return losses, found


def gradients_here(scene: Path, rays: int, empty: bool):
    return gradients(here(scene), rays, SeveralRanks(), empty)


@pytest.mark.parametrize(("rays", "empty"), [(200, False), (201, False), (200, True), (1, False)])
def test_losses_and_gradients_are_those_of_one_process_with_all_rays(
    two_ranks, prepared, toy_folder, rays, empty
):
    losses, expected = gradients(prepared, rays, ALONE, empty)
    for joint, found in two_ranks(gradients_here, toy_folder, rays, empty):
        assert joint == pytest.approx(losses, rel=1e-5)
        assert found.keys() == expected.keys()
        for name, gradient in expected.items():
            off = np.linalg.norm(found[name] - gradient)
            assert off <= 1e-4 * np.linalg.norm(gradient), name


def train_here(
    scene: Path,
    workspace: Path,
    schedule: ScheduleConfig = SCHEDULE,
    seconds_per_look: tuple[float, float] | None = None,
    spoilt: int | None = None,
):
    """Train as one of two ranks: the result, and what its weights add up to.

    The second rank is given a folder of its own, and a spoilt one's losses are no numbers.
    """
    prepared, ranks = here(scene), SeveralRanks()
    clock = TrainingClock()
    if seconds_per_look:
        clock = TrainingClock(now=SlowClock(per_look=seconds_per_look[ranks.rank]))
    problem = problem_of(prepared, ranks=ranks)
    if ranks.rank == spoilt:
        losses_of = problem.objective
        spoiling = lambda *given: {n: v * torch.nan for n, v in losses_of(*given).items()}  # noqa: E731
        problem = replace(problem, objective=spoiling)
    folder = workspace if ranks.is_first else workspace.with_name("second")
    result = optimise_scene(
        prepared.clip, problem, schedule, 0, Seconds(), folder, silent, clock=clock
    )
    return asdict(result), digest(problem.field.state_dict())


def digest(weights: dict[str, torch.Tensor]) -> str:
    content = b"".join(weights[name].numpy().tobytes() for name in sorted(weights))
    return hashlib.sha256(content).hexdigest()


def parameters(folder: Path) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


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


def killed_here(scene: Path, workspace: Path) -> None:
    """Train as one of two ranks until the tenth step, with a checkpoint of each."""
    prepared = here(scene)
    problem = problem_of(prepared, ranks=SeveralRanks())
    losses_of, calls = problem.objective, iter(range(11))  # the first one tells the start's losses

    def killed(batch: Batch, generator: torch.Generator) -> dict[str, torch.Tensor]:
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return losses_of(batch, generator)

    problem = replace(problem, objective=killed)
    with suppress(KeyboardInterrupt):
        optimise_scene(prepared.clip, problem, CAREFUL, 0, Seconds(), workspace, silent)


def killed_alone(prepared: Prepared, workspace: Path) -> None:
    def killed(fraction: float, text: str) -> None:
        raise KeyboardInterrupt

    with suppress(KeyboardInterrupt):
        train(prepared, workspace, schedule=CAREFUL, progress=killed)


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


def failing_here() -> str:
    def failing() -> str:
        raise OSError("the disk is gone")

    try:
        return SeveralRanks().first(failing)
    except OSError as error:
        return f"first: {error}"
    except FirstRankFailed:
        return "told"


def test_a_failure_of_the_first_rank_reaches_those_that_wait_for_it(two_ranks):
    assert two_ranks(failing_here) == ["first: the disk is gone", "told"]


def agreements_here():
    ranks = SeveralRanks()
    return (
        ranks.first(lambda: {"rank": ranks.rank, "none": None}),
        ranks.first_bytes(lambda: bytes(range(256)) * 300),
        ranks.before(3 + 2 * ranks.rank),
        float(ranks.total(torch.tensor(1.0 + ranks.rank))),
        ranks.seconds(Seconds(1.0 + ranks.rank, 10.0 + ranks.rank)),
    )


def test_all_ranks_agree(two_ranks):
    first, second = two_ranks(agreements_here)
    assert first[2] == (0, 8)
    assert second[2] == (3, 8)
    for agreed in (first, second):
        assert agreed[0] == {"rank": 0, "none": None}
        assert agreed[1] == bytes(range(256)) * 300
        assert agreed[3:] == (3.0, Seconds(1.0, 21.0))
