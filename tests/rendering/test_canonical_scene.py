"""Density, colour and the surface's place in canonical space, of both representations."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.fields.network_field import NetworksConfig
from mocoflow_core.fields.network_shape import NetworkShape
from mocoflow_core.fields.skip_network import SkipConfig
from mocoflow_core.rendering.box_space import BoxSpace
from mocoflow_core.rendering.frame_box import FrameBoxes
from tests.toy_training import SHELL_M

MARGIN_M, DEPTH_M, COARSE = 0.4, 1.6, 8
VERTICES = np.array([[-0.2, -0.1, 0.0], [0.2, 0.1, 1.8]], np.float32)


@pytest.fixture
def networks():
    """The space and the fields of tiny networks that see the direction too."""
    small = SkipConfig(layers=2, width=16, skip=0)
    config = NetworksConfig(radiance=small, motion=small, colour_width=8)
    config = config.model_copy(update={"colour_sees": "point_and_direction"})
    shape = NetworkShape(
        networks=config,
        times=(0.0, 1.0),
        centre_m=(0.0, 0.0, 0.9),
        radius_m=0.9 + MARGIN_M,
        coarse_samples=COARSE,
        fine_samples=8,
    )
    lower = torch.tensor([[-0.6, -0.6, 2.0], [-0.6, -0.6, 2.2]])
    upper = lower + torch.tensor([[1.2, 2.0, DEPTH_M - 0.2], [1.2, 2.0, DEPTH_M + 0.2]])
    times = torch.tensor([0.0, 1.0], dtype=torch.float64)
    boxes = FrameBoxes(torch.eye(3), times, lower, upper, 0.5 * (lower + upper))
    torch.manual_seed(0)
    space = BoxSpace(shape, boxes, VERTICES)
    field = space.build()
    field.requires_grad_(False).anneal(8.0)
    field.appearance[:] = torch.randn(2, config.appearance_width)
    return space, field


@pytest.fixture
def hybrid(prepared):
    field = prepared.field()
    return field.requires_grad_(False), prepared.space.canonical(field)


def test_half_of_the_shell_s_largest_density_stands_on_the_prior_s_surface(prepared, hybrid):
    field, canonical = hybrid
    grid = field.canonical
    deepest = float(grid.density(torch.tensor([-9.0])))
    assert canonical.surface_density == pytest.approx(0.5 * deepest)
    points = torch.rand(4000, 3) * 2 - torch.tensor([1.0, 1.0, 0.0])
    head = grid.geometry(grid.features(points))[:, 0]
    inside = grid.prior(points) < grid.offset_m(head)
    assert torch.equal(canonical.density(points) > canonical.surface_density, inside)


def test_nothing_is_beyond_the_shell(prepared, hybrid):
    field, canonical = hybrid
    lower, upper = (torch.from_numpy(corner).float() for corner in canonical.box)
    points = lower + torch.rand(4000, 3) * (upper - lower)
    beyond = field.canonical.prior(points) > SHELL_M
    assert beyond.any()
    assert not canonical.density(points)[beyond].any()
    body = prepared.space.canonical_vertices
    assert lower.numpy() == pytest.approx(body.min(0) - SHELL_M)
    assert upper.numpy() == pytest.approx(body.max(0) + SHELL_M)


def test_a_step_between_coarse_samples_is_half_opaque_on_a_network_s_surface(networks):
    space, field = networks
    canonical = space.canonical(field)
    step_m = DEPTH_M / COARSE
    assert 1 - np.exp(-canonical.surface_density * step_m) == pytest.approx(0.5)


def test_a_network_is_looked_at_in_the_canonical_box(networks):
    space, field = networks
    lower, upper = space.canonical(field).box
    assert lower == pytest.approx(VERTICES[0] - MARGIN_M, abs=1e-6)
    assert upper == pytest.approx(VERTICES[1] + MARGIN_M, abs=1e-6)


def test_a_network_s_colours_are_those_of_the_mean_code_and_the_given_side(networks):
    space, field = networks
    points = torch.rand(30, 3)
    looking = torch.nn.functional.normalize(torch.randn(30, 3), dim=1)
    found = space.canonical(field).colour(points, looking)
    density, hidden = field.density(field.fine, points)
    code = field.appearance.mean(0).expand(30, -1)
    assert torch.equal(found, field.fine.colour(hidden, code, looking))
    assert torch.equal(space.canonical(field).density(points), density)
    assert not torch.equal(found, space.canonical(field).colour(points, -looking))
