from __future__ import annotations

import pytest
import torch

from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior

SPACING = 0.02
ORIGIN = torch.tensor([-0.4, -0.5, 0.6])
CENTRE = torch.tensor([0.05, -0.02, 1.1])
RADIUS = 0.25


def lattice_points() -> torch.Tensor:
    axes = [ORIGIN[a] + SPACING * torch.arange(n) for a, n in enumerate((46, 49, 51))]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), -1)


def sphere() -> SignedDistancePrior:
    return SignedDistancePrior((lattice_points() - CENTRE).norm(dim=-1) - RADIUS, ORIGIN, SPACING)


def directions(count: int = 200) -> torch.Tensor:
    draws = torch.randn(count, 3, generator=torch.Generator().manual_seed(0))
    return torch.nn.functional.normalize(draws, dim=-1)


def test_lattice_points_get_their_own_value():
    prior = sphere()
    found = prior(lattice_points().reshape(-1, 3))
    # Coordinates pass through [-1, 1]: rounding of a fraction of a cell.
    assert found.numpy() == pytest.approx(prior.lattice.flatten().numpy(), abs=1e-6)


def test_linear_distances_are_reproduced_between_lattice_points():
    slope = torch.tensor([0.3, -0.5, 0.8])
    plane = SignedDistancePrior(lattice_points() @ slope, ORIGIN, SPACING)
    points = CENTRE + 0.3 * directions()
    assert plane(points).numpy() == pytest.approx((points @ slope).numpy(), abs=1e-6)


def test_a_sphere_s_distance_and_normals_are_those_of_the_closed_form():
    prior, outwards = sphere(), directions()
    for radius in (0.15, 0.25, 0.33):
        points = CENTRE + radius * outwards
        # Trilinear interpolation of a curved function: spacing^2 / (8 radius) per axis.
        assert prior(points).numpy() == pytest.approx(radius - RADIUS, abs=1.5e-3)
        normals = prior.normals(points)
        assert normals.norm(dim=-1).numpy() == pytest.approx(1.0, abs=1e-5)
        assert (normals * outwards).sum(-1).min() > 0.99


def test_points_beyond_the_lattice_take_its_border():
    prior = sphere()
    far = torch.tensor([[1e6, 0.0, 1.1], [-50.0, -50.0, -50.0]])
    border = ORIGIN + SPACING * torch.tensor([[45.0, 25.0, 25.0], [0.0, 0.0, 0.0]])
    border[0, 1:] = far[0, 1:]
    assert prior(far).numpy() == pytest.approx(prior(border).numpy(), abs=1e-6)
    assert (prior(far) > 0).all()


def test_gradients_are_finite_inside_on_the_border_and_beyond():
    prior = sphere()
    points = torch.cat([CENTRE + 0.1 * directions(20), ORIGIN[None], 1e3 * directions(5)])
    points.requires_grad_()
    prior(points).sum().backward()
    assert torch.isfinite(points.grad).all()


def test_normals_at_the_centre_of_a_sphere_are_finite():
    middle = CENTRE.round(decimals=2)
    symmetric = SignedDistancePrior((lattice_points() - middle).norm(dim=-1), ORIGIN, SPACING)
    assert torch.isfinite(symmetric.normals(middle[None])).all()
