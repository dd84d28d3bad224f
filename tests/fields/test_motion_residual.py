from __future__ import annotations

import torch

from mocoflow_core.fields.motion_residual import ResidualConfig, ResidualMotion

CENTRE = torch.tensor([0.3, -0.2, 1.0])


def residual(seed: int = 0) -> ResidualMotion:
    torch.manual_seed(seed)
    return ResidualMotion(CENTRE, 0.9, ResidualConfig(hidden=16, code_width=4))


def points(scale: float = 1.0) -> torch.Tensor:
    return CENTRE + scale * torch.randn(64, 3, generator=torch.Generator().manual_seed(1))


def codes() -> torch.Tensor:
    return torch.randn(64, 4, generator=torch.Generator().manual_seed(2))


def test_the_start_is_the_identity_for_every_code_and_band_alpha():
    for band_alpha in (0.0, 1.5, 4.0):
        field = residual()
        field.encoding.anneal(band_alpha)
        # Points go through coordinates about the centre and back: rounding remains.
        assert (field(points(), codes()) - points()).abs().max() < 1e-6


def test_the_start_can_learn():
    field = residual()
    field(points(), codes()).sum().backward()
    assert field.network[-1].bias.grad.abs().min() > 0
    assert all(torch.isfinite(p.grad).all() for p in field.parameters())


def test_a_constant_twist_is_one_rigid_motion_of_all_points():
    field = residual()
    with torch.no_grad():
        field.network[-1].bias.copy_(torch.tensor([0.4, -0.8, 0.3, 0.1, 0.2, -0.3]))
    moved = field(points(), codes()).detach()
    assert (torch.pdist(moved) - torch.pdist(points())).abs().max() < 1e-5
    assert (moved - points()).norm(dim=-1).min() > 0.05


def test_points_far_away_stay_finite():
    field = residual()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    field.encoding.anneal(4.0)
    far = points(1e4).requires_grad_()
    moved = field(far, codes())
    moved.sum().backward()
    assert torch.isfinite(moved).all()
    assert torch.isfinite(far.grad).all()
