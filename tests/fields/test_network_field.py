"""The paper's networks: sizes, the start, and what annealing may not change."""

from __future__ import annotations

import pytest
import torch

from mocoflow_core.fields.network_field import NetworkField, NetworksConfig, density_parameters
from mocoflow_core.fields.skip_network import SkipConfig

SMALL = SkipConfig(layers=3, width=16, skip=1)
CENTRE, RADIUS = torch.tensor([0.3, -0.2, 0.9]), 1.4


def field(**changes) -> NetworkField:
    torch.manual_seed(0)
    sizes = {"radiance": SMALL, "motion": SMALL, "colour_width": 8} | changes
    return NetworkField(torch.tensor([0.0, 0.5, 1.0]), CENTRE, RADIUS, NetworksConfig(**sizes))


def points(count: int = 50) -> torch.Tensor:
    return CENTRE + RADIUS * (2.0 * torch.rand(count, 3) - 1.0)


def weights(module: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def test_the_default_networks_have_the_paper_s_eight_layers_of_256():
    built = NetworkField(torch.tensor([0.0, 1.0]), CENTRE, RADIUS, NetworksConfig())
    position, time, width = 3 * (1 + 2 * 8), 1 + 2 * 16, 256

    def trunk(inputs: int) -> int:
        return (inputs + 1) * width + 6 * (width + 1) * width + (width + inputs + 1) * width

    assert weights(built.canonical_motion) == trunk(position + time) + (width + 1) * 6
    heads = (width + 1) * (1 + width) + (width + 8 + 1) * 128 + (128 + 1) * 3
    assert weights(built.fine) == trunk(position) + heads
    assert built.appearance.shape == (2, 8)


def test_both_motions_start_as_the_identity_at_every_time():
    built, at = field(), points()
    built.anneal(8.0)
    code = built.time_codes(torch.rand(50))
    assert torch.allclose(built.to_canonical(at, code), at, atol=1e-6)
    assert torch.allclose(built.to_observed(at, code), at, atol=1e-6)


def test_a_body_that_stands_still_asks_no_network():
    built, at = field(), points()
    with torch.no_grad():
        built.canonical_motion.head.bias.fill_(0.3)
    code = built.time_codes(torch.zeros(50))
    assert not torch.allclose(built.to_canonical(at, code), at)
    built.moves = False
    assert torch.equal(built.to_canonical(at, code), at)


def test_without_bands_only_the_coordinates_are_seen():
    built, at = field(), points()
    built.anneal(0.0)
    encoded = built.encoding(built.to_local(at))
    assert torch.equal(encoded[:, 3:], torch.zeros_like(encoded[:, 3:]))
    built.anneal(8.0)
    assert built.encoding(built.to_local(at))[:, 3:].abs().amax() > 0.9


def test_time_keeps_all_its_bands_whatever_is_annealed():
    built = field()
    before = built.time_codes(torch.tensor([0.3]))
    built.anneal(0.0)
    assert torch.equal(built.time_codes(torch.tensor([0.3])), before)
    assert before.shape == (1, 33)


def test_fog_fills_all_of_the_box_at_the_start_so_that_density_can_learn():
    density, _ = field().density(field().fine, points(1000))
    assert (density > 0).float().mean() > 0.9


@pytest.mark.parametrize("sees", ["point", "point_and_direction"])
def test_colours_depend_on_the_direction_only_in_the_ablation(sees):
    built, at = field(colour_sees=sees), points()
    _, hidden = built.density(built.fine, at)
    codes = torch.zeros(50, 8)
    toward, away = torch.eye(3)[0].expand(50, 3), -torch.eye(3)[0].expand(50, 3)
    same = torch.equal(
        built.fine.colour(hidden, codes, toward), built.fine.colour(hidden, codes, away)
    )
    assert same == (sees == "point")


def test_every_parameter_learns_at_exactly_one_rate():
    built = field()
    grouped = [id(parameter) for group in built.rate_groups() for parameter in group]
    assert sorted(grouped) == sorted(id(parameter) for parameter in built.parameters())
    assert {id(p) for p in density_parameters(built)} < set(grouped)


def test_the_field_does_not_jump_at_the_border_of_two_stages():
    # Fitting ends and the joint stage begins with no band on.
    built, at = field(), points()
    built.anneal(0.0)
    before, _ = built.density(built.fine, at)
    built.anneal(1e-3)
    after, _ = built.density(built.fine, at)
    assert torch.allclose(before, after, atol=1e-4)
