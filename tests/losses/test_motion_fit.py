from __future__ import annotations

import pytest
import torch

from mocoflow_core.losses.motion_fit import correspondence_fit, free_space


def test_correspondence_is_zero_at_the_target_and_counts_axes_in_metres():
    target = torch.randn(20, 3, generator=torch.Generator().manual_seed(0))
    assert float(correspondence_fit(target, target)) == 0.0
    moved = target + torch.tensor([0.1, -0.2, 0.0])
    assert float(correspondence_fit(moved, target)) == pytest.approx(0.3, rel=1e-5)


def test_free_space_is_the_cross_entropy_of_one_step_s_opacity():
    density = torch.logspace(-3, 2.5, 40, dtype=torch.float64)
    for step_m in (0.005, 0.02):
        opacity = -torch.expm1(-density * step_m)
        entropy = torch.nn.functional.binary_cross_entropy(opacity, torch.zeros_like(opacity))
        assert float(free_space(density, step_m)) == pytest.approx(float(entropy), rel=1e-9)


@pytest.mark.parametrize("value", [0.0, 1e-12, 2000.0, 1e6, 1e30])
def test_free_space_pulls_equally_at_every_density(value):
    # Through a saturated opacity the pull would explode near 2000 per metre and vanish after.
    density = torch.full((4,), value, requires_grad=True)
    free_space(density, 0.01).backward()
    assert density.grad.tolist() == pytest.approx([0.01 / 4] * 4)
