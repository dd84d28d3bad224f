from __future__ import annotations

import pytest
import torch

from mocoflow_core.losses.photometric import photometric, silhouette


def test_equal_pictures_cost_nothing_and_pull_nowhere():
    rgb = torch.rand(30, 3, generator=torch.Generator().manual_seed(0), requires_grad=True)
    loss = photometric(rgb, rgb.detach())
    loss.backward()
    assert float(loss.detach()) == 0.0
    assert not rgb.grad.any()


def test_a_constant_difference_costs_its_square():
    rgb = torch.rand(30, 3, generator=torch.Generator().manual_seed(0))
    assert float(photometric(rgb + 0.1, rgb)) == pytest.approx(0.01, rel=1e-4)
    assert float(silhouette(torch.full((7,), 0.3), torch.ones(7))) == pytest.approx(0.49)


def test_opacity_at_its_ends_has_a_finite_gradient():
    opacity = torch.tensor([0.0, 1.0, 0.0, 1.0], requires_grad=True)
    silhouette(opacity, torch.tensor([0.0, 0.0, 1.0, 1.0])).backward()
    assert opacity.grad.tolist() == pytest.approx([0.0, 0.5, -0.5, 0.0])


def test_parts_of_a_step_add_up_to_its_mean():
    generator = torch.Generator().manual_seed(0)
    rendered, observed = torch.rand(2, 30, 3, generator=generator)
    opacity, mask = torch.rand(2, 30, generator=generator)
    parts = (slice(0, 7), slice(7, 7), slice(7, 30))
    colours = sum(float(photometric(rendered[p], observed[p], 30)) for p in parts)
    outlines = sum(float(silhouette(opacity[p], mask[p], 30)) for p in parts)
    assert colours == pytest.approx(float(((rendered - observed) ** 2).mean()), rel=1e-5)
    assert outlines == pytest.approx(float(((opacity - mask) ** 2).mean()), rel=1e-5)
