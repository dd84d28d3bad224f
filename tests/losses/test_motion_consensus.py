from __future__ import annotations

import pytest
import torch
from scipy.spatial.transform import Rotation

from mocoflow_core.geometry.se3 import transform_points
from mocoflow_core.losses.motion_consensus import global_consensus, local_consensus

OFFSET = torch.tensor([0.02, -0.05, 0.01], dtype=torch.float64)
L1 = float(OFFSET.abs().sum())


def points(count: int = 40) -> torch.Tensor:
    return torch.randn(count, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


def row(count: int = 40) -> torch.Tensor:
    return torch.arange(count) % 3


def everywhere(moved: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    return moved, torch.ones(len(moved), dtype=torch.bool)


def nowhere(moved: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    return moved, torch.zeros(len(moved), dtype=torch.bool)


def turning(seed: int = 0):
    """Rigid motions of three moments, and their inverses."""
    turns = Rotation.random(3, random_state=seed).as_rotvec()
    twists = torch.cat([torch.from_numpy(turns), points(3)], -1)
    return (
        lambda x, moment: everywhere(transform_points(twists[moment], x)),
        lambda x, moment: everywhere(transform_points(-twists[moment], x)),
    )


def test_exact_inverses_agree_at_one_moment_and_across_two():
    to_canonical, to_observed = turning()
    assert float(local_consensus(to_canonical, to_observed, points(), row())) < 1e-13
    other = (row() + 1) % 3
    assert float(global_consensus(to_canonical, to_observed, points(), row(), other)) < 1e-13


def test_a_constant_offset_counts_once_at_one_moment_and_twice_across_two():
    def to_canonical(x, moment):
        return everywhere(x + moment[:, None])

    def to_observed(x, moment):
        return everywhere(x - moment[:, None] + OFFSET)

    local = local_consensus(to_canonical, to_observed, points(), row())
    assert float(local) == pytest.approx(L1)
    far = global_consensus(to_canonical, to_observed, points(), row(), (row() + 1) % 3)
    assert float(far) == pytest.approx(2 * L1)
    same = global_consensus(to_canonical, to_observed, points(), row(), row())
    assert float(same) == pytest.approx(2 * L1)


def test_the_other_moment_is_really_visited():
    # The directions disagree at moment 2 alone.
    def to_canonical(x, moment):
        return everywhere(x)

    def to_observed(x, moment):
        return everywhere(x + (moment == 2)[:, None] * OFFSET)

    here = torch.zeros(40, dtype=torch.int64)
    assert float(local_consensus(to_canonical, to_observed, points(), here)) == 0
    for other, expected in ((1, 0.0), (2, L1)):
        found = global_consensus(
            to_canonical, to_observed, points(), here, torch.full((40,), other)
        )
        assert float(found) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("count", [0, 40])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_an_empty_selection_gives_exactly_zero_with_a_finite_gradient(count, dtype):
    scale = torch.ones(1, dtype=dtype, requires_grad=True)

    def unknown(x, moment):
        return nowhere(scale * x)

    chosen = points(count).to(dtype)
    here = torch.zeros(count, dtype=torch.int64)
    for loss in (
        local_consensus(unknown, unknown, chosen, here),
        global_consensus(unknown, unknown, chosen, here, here),
    ):
        assert float(loss.detach()) == 0.0
        scale.grad = None
        loss.backward()
        assert scale.grad.tolist() == [0.0]


def test_points_where_the_motion_is_unknown_count_neither_above_nor_below():
    known = torch.arange(40) < 10

    def to_canonical(x, moment):
        return x, known

    def to_observed(x, moment):
        return x + torch.where(known[:, None], OFFSET, 1e3), torch.ones(40, dtype=torch.bool)

    assert float(local_consensus(to_canonical, to_observed, points(), row())) == pytest.approx(L1)


def test_gradients_are_those_of_finite_differences():
    def losses(offset):
        def to_canonical(x, moment):
            return everywhere(torch.sin(x) + offset)

        def to_observed(x, moment):
            return everywhere(x * (1 + offset) + 0.1 * moment[:, None])

        other = (row() + 1) % 3
        return local_consensus(to_canonical, to_observed, points(), row()) + global_consensus(
            to_canonical, to_observed, points(), row(), other
        )

    assert torch.autograd.gradcheck(losses, OFFSET.clone().requires_grad_())


def test_a_chain_through_stretching_motions_stays_within_its_bound():
    # Each inverse misses by epsilon; every further map stretches what came before.
    stretch, epsilon = 8.0, 1e-4

    def to_canonical(x, moment):
        return everywhere(x * stretch + epsilon)

    def to_observed(x, moment):
        return everywhere(x / stretch)

    far = global_consensus(to_canonical, to_observed, points(), row(), row())
    assert 0 < float(far) <= 3 * epsilon * (stretch**4 - 1) / (stretch - 1)


def test_an_almost_collapsed_region_keeps_gradients_finite():
    squeeze = torch.tensor([1e-12], dtype=torch.float64, requires_grad=True)

    def to_canonical(x, moment):
        return everywhere(x * squeeze)

    def to_observed(x, moment):
        return everywhere(x / squeeze.detach())

    local_consensus(to_canonical, to_observed, points(), row()).backward()
    assert torch.isfinite(squeeze.grad).all()
