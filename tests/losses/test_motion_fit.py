"""L_fit: distance from the mesh's partners, and nothing in free space."""

from __future__ import annotations

import math

import pytest
import torch

from mocoflow_core.losses.motion_fit import correspondence, free_space


def test_points_where_the_mesh_has_them_cost_nothing_and_a_shift_its_length():
    points = torch.randn(30, 3, dtype=torch.float64)
    assert float(correspondence(points, points)) == 0.0
    shift = torch.tensor([0.01, -0.02, 0.0], dtype=torch.float64)
    assert float(correspondence(points + shift, points)) == pytest.approx(0.03)


def test_no_points_cost_exactly_nothing_and_have_a_gradient():
    empty = torch.empty(0, 3, requires_grad=True)
    loss = correspondence(empty, torch.empty(0, 3)) + free_space(empty[:, 0], 0.02)
    loss.backward()
    assert float(loss.detach()) == 0.0


@pytest.mark.parametrize("density", [1e-6, 0.3, 20.0])
def test_free_space_is_the_cross_entropy_of_the_opacity_of_a_step(density):
    step = 0.02
    alpha = -math.expm1(-density * step)
    exact = -math.log1p(-alpha)  # the binary cross-entropy against 0
    found = free_space(torch.tensor([density], dtype=torch.float64), step)
    assert float(found) == pytest.approx(exact, rel=1e-9)


def test_free_space_pulls_as_hard_at_a_density_that_saturates_the_opacity():
    density = torch.tensor([1e5], requires_grad=True)
    free_space(density, 0.02).backward()
    assert float(density.grad) == pytest.approx(0.02)
