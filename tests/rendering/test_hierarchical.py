"""Coarse and fine samples: where they stand and what they stand for."""

from __future__ import annotations

import pytest
import torch

from mocoflow_core.rendering.compositing import composite
from mocoflow_core.rendering.hierarchical import borders, draw_where_weight_is, spread_evenly

NEAR, FAR = torch.tensor([1.0, 2.0]), torch.tensor([3.0, 2.5])


def jitter(count: int) -> torch.Tensor:
    return torch.rand(2, count, generator=torch.Generator().manual_seed(0))


def test_each_coarse_sample_lies_in_its_part_of_the_ray():
    distance = spread_evenly(NEAR, FAR, jitter(64))
    part = (distance - NEAR[:, None]) / (FAR - NEAR)[:, None] * 64
    assert torch.equal(part.floor().clamp(0, 63), torch.arange(64.0).expand(2, 64))


@pytest.mark.parametrize("count", [1, 2, 64])
@pytest.mark.parametrize("density", [0.0, 0.7, 40.0])
def test_constant_density_is_rendered_exactly_from_any_samples(count, density):
    distance = spread_evenly(NEAR, FAR, jitter(count))
    step = borders(distance, NEAR, FAR).diff(dim=1)
    assert (step > 0).all()
    ray = torch.arange(2).repeat_interleave(count)
    filled = torch.full((2 * count,), density)
    _, transmittance = composite(filled, step.reshape(-1), ray, 2)
    # Float32 sums of up to 64 steps.
    assert torch.allclose(transmittance, torch.exp(-density * (FAR - NEAR)), atol=1e-5)


def test_even_weights_spread_the_fine_samples_evenly():
    edges = torch.linspace(0.0, 1.0, 65)[None]
    found = draw_where_weight_is(edges, torch.ones(1, 64), torch.full((1, 128), 0.5))
    assert torch.allclose(found[0], (torch.arange(128) + 0.5) / 128, atol=1e-5)


def test_fine_samples_go_where_the_weight_is():
    edges = torch.linspace(0.0, 1.0, 11)[None]
    weights = torch.zeros(1, 10)
    weights[0, 3], weights[0, 7] = 0.75, 0.25
    found = draw_where_weight_is(edges, weights, torch.full((1, 400), 0.5))[0]
    assert ((found >= 0.3) & (found <= 0.4)).float().mean() == pytest.approx(0.75, abs=0.01)
    assert ((found >= 0.7) & (found <= 0.8)).float().mean() == pytest.approx(0.25, abs=0.01)


def test_a_ray_without_weight_and_one_without_length_stay_finite():
    distance = spread_evenly(torch.tensor([1.0, 2.0]), torch.tensor([3.0, 2.0]), jitter(8))
    edges = borders(distance, torch.tensor([1.0, 2.0]), torch.tensor([3.0, 2.0]))
    found = draw_where_weight_is(edges, torch.zeros(2, 8), jitter(16))
    assert torch.isfinite(found).all()
    assert ((found[0] >= 1.0) & (found[0] <= 3.0)).all()
    assert (found[1] == 2.0).all()


def test_fine_samples_are_sorted_and_within_the_ray():
    edges = borders(spread_evenly(NEAR, FAR, jitter(64)), NEAR, FAR)
    weights = torch.rand(2, 64, generator=torch.Generator().manual_seed(1)) ** 8
    found = draw_where_weight_is(edges, weights, jitter(128))
    assert (found.diff(dim=1) >= 0).all()
    assert (found >= NEAR[:, None]).all()
    assert (found <= FAR[:, None]).all()
