from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.fit_points import FitPoints
from mocoflow_core.training.network_objective import NetworkObjective
from mocoflow_core.training.network_stages import network_space
from mocoflow_core.training.problem import Problem
from mocoflow_core.training.ranks import ALONE, FirstRankFailed, Ranks, SeveralRanks
from tests.joint_training import here
from tests.toy_training import Prepared, problem_of
from tests.training.test_network_stages import BOX, NETWORKS


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
    parts = [whole.own_part(Share(rank, 3)) for rank in range(3)]
    for name in ("row", "near", "far", "rgb", "mask", "background", "jitter"):
        joined = torch.cat([getattr(part, name) for part in parts])
        assert torch.equal(joined, getattr(whole, name)), name
    assert torch.equal(torch.cat([part.rays.origins for part in parts]), whole.rays.origins)
    assert {(part.rays_in_all, part.first_row) for part in parts} == {(50, int(whole.row[0]))}


def shell(prepared: Prepared, ranks: Ranks) -> Problem:
    """The fast representation off its start, where most losses are zero."""
    problem = problem_of(prepared, ranks=ranks)
    problem.field.anneal(2.0)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weight in problem.field.parameters():
            weight.add_(0.02 * torch.randn(weight.shape, generator=generator))
    return problem


def networks(prepared: Prepared, ranks: Ranks) -> Problem:
    """The paper's networks while their motion is fitted to the mesh: all losses that there are."""
    clip, meshes = prepared.clip, prepared.meshes
    losses = LossConfig(consensus_points=100, fit_points=30)
    torch.manual_seed(0)
    first = int(clip.frame_indices[0])
    space = network_space(clip, meshes, first, True, "frame", NETWORKS, BOX)
    field = space.build()
    scene = space.at(field, torch.from_numpy(clip.times[~clip.held_out]))
    posed = meshes.at(clip.frame_indices[~clip.held_out])
    points = FitPoints(posed.vertices, posed.faces, space.canonical_vertices, scene.boxes, losses)
    objective = NetworkObjective(scene, losses, True, points, ranks)
    return Problem(space, field, scene, objective, {}, ranks)


MAKE = {"shell": shell, "networks": networks}


def gradients(prepared: Prepared, kind: str, rays: int, ranks: Ranks, empty: bool):
    """Joint losses and gradients of a first step."""
    problem = MAKE[kind](prepared, ranks)
    generator = torch.Generator().manual_seed(0)
    batch = TrainingPixels(prepared.clip, problem.scene).batch(rays, 4, generator)
    if empty:
        # The second half of all rays meets nothing.
        gone = torch.arange(rays) >= rays // 2
        batch = replace(batch, far=torch.where(gone, batch.near, batch.far))
    losses_of = ranks.share(problem.field, problem.objective)
    terms = losses_of(batch.own_part(ranks), generator)
    (torch.stack(list(terms.values())).sum() * ranks.count).backward()
    losses = {name: float(ranks.total(value.detach())) for name, value in terms.items()}
    named = problem.field.named_parameters()
    return losses, {name: p.grad.numpy() for name, p in named if p.grad is not None}


def gradients_here(scene: Path, kind: str, rays: int, empty: bool):
    return gradients(here(scene), kind, rays, SeveralRanks(), empty)


@pytest.mark.parametrize("kind", MAKE)
@pytest.mark.parametrize(("rays", "empty"), [(200, False), (201, False), (200, True), (1, False)])
def test_losses_and_gradients_are_those_of_one_process_with_all_rays(
    two_ranks, prepared, toy_folder, kind, rays, empty
):
    losses, expected = gradients(prepared, kind, rays, ALONE, empty)
    for joint, found in two_ranks(gradients_here, toy_folder, kind, rays, empty):
        assert joint == pytest.approx(losses, rel=1e-5)
        assert found.keys() == expected.keys()
        for name, gradient in expected.items():
            off = np.linalg.norm(found[name] - gradient)
            assert off <= 1e-4 * np.linalg.norm(gradient), name


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
