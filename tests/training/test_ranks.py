from __future__ import annotations

from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.clock import TrainingClock
from mocoflow_core.training.objective import ShellObjective
from mocoflow_core.training.ranks import ALONE, Ranks, SeveralRanks
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import read_snapshots
from tests.toy_training import SCHEDULE, Prepared, prepare, train
from tests.training.slow_clock import SlowClock

LOSSES = LossConfig(consensus_points=40)
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


@pytest.mark.parametrize("count", [2, 3])
def test_the_ranks_batches_are_the_parts_of_one(prepared, count):
    def batch(ranks: Ranks):
        pixels = TrainingPixels(prepared.clip, prepared.scene(), None, ranks)
        return pixels.batch(50, 4, torch.Generator().manual_seed(0))

    whole, parts = batch(ALONE), [batch(Share(rank, count)) for rank in range(count)]
    for name in ("row", "near", "far", "rgb", "mask", "background", "jitter"):
        joined = torch.cat([getattr(part, name) for part in parts])
        assert torch.equal(joined, getattr(whole, name)), name
    assert {part.rays_in_all for part in parts} == {50}


def gradients(prepared: Prepared, rays: int, ranks: Ranks, empty: bool = False):
    """Joint losses and gradients of a first step, with directions that disagree."""
    field = prepared.field()
    field.anneal(2.0)
    with torch.no_grad():
        for weight in field.parameters():
            if not weight.any():
                weight.add_(0.02)
    scene = prepared.scene(field)
    pixels = TrainingPixels(prepared.clip, scene, None, ranks)
    generator = torch.Generator().manual_seed(0)
    batch = pixels.batch(rays, 4, generator)
    if empty:
        # The second half of all rays meets nothing.
        gone = torch.arange(rays)[ranks.part(rays)] >= rays // 2
        batch = replace(batch, far=torch.where(gone, batch.near, batch.far))
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
    spoilt_by: int | None = None,
):
    """Train as one of two ranks; the second one is given a folder of its own."""
    prepared, ranks = here(scene), SeveralRanks()
    clock = TrainingClock()
    if seconds_per_look:
        clock = TrainingClock(now=SlowClock(per_look=seconds_per_look[ranks.rank]))
    if ranks.rank == spoilt_by:
        controls = prepared.motion
        frames = np.array(prepared.clip.frames, np.float32)
        frames[:] = np.nan
        prepared = replace(prepared, clip=replace(prepared.clip, frames=frames), motion=controls)
    folder = workspace if ranks.is_first else workspace.with_name("second")
    result = train(prepared, folder, schedule=schedule, losses=LOSSES, clock=clock, ranks=ranks)
    return asdict(result)


def parameters(folder: Path) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


def test_two_ranks_end_with_the_losses_and_score_of_one(two_ranks, prepared, toy_folder, tmp_path):
    alone = train(prepared, tmp_path / "alone", losses=LOSSES)
    first, second = two_ranks(train_here, toy_folder, tmp_path / "joint")
    assert first == second
    assert first["steps"] == alone.steps == SCHEDULE.joint_steps
    assert first["losses"] == pytest.approx(alone.losses, rel=1e-3)
    assert first["train_psnr"] == pytest.approx(alone.train_psnr, abs=0.02)


def test_only_the_first_rank_writes(two_ranks, toy_folder, tmp_path):
    two_ranks(train_here, toy_folder, tmp_path / "joint", CAREFUL)
    assert (tmp_path / "joint" / "model.safetensors").exists()
    assert len(read_snapshots(tmp_path / "joint")) >= 1
    assert not (tmp_path / "second").exists()
