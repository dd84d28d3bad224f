"""The paper's rendering at a price: nothing that is left out may change a value or a gradient."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from benchmarks.plain_networks import PlainBoxScene, plain_losses
from mocoflow_core.fields.network_field import NetworkField, NetworksConfig
from mocoflow_core.fields.skip_network import SkipConfig
from mocoflow_core.geometry.rays import Rays, pixel_rays
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.box_scene import BoxScene
from mocoflow_core.rendering.frame_box import BoxConfig, frame_boxes
from mocoflow_core.training.batches import Batch
from mocoflow_core.training.network_objective import NetworkObjective
from tests.capsule_person import look_at

SMALL = SkipConfig(layers=3, width=24, skip=1)
CAMERA = look_at([0.0, -3.0, 1.0], [0.0, 0.0, 0.9], 40.0, 32, 32)
COARSE, FINE = 12, 20
LOSSES = LossConfig(silhouette_weight=0.0, consensus_points=None)


def field() -> NetworkField:
    """Networks with density in a part of the box and motions that are no longer the identity."""
    torch.manual_seed(3)
    config = NetworksConfig(radiance=SMALL, motion=SMALL, colour_width=8)
    built = NetworkField(torch.tensor([0.0, 0.4, 1.0]), torch.tensor([0.0, 0.0, 0.9]), 1.2, config)
    built.anneal(3.0)
    with torch.no_grad():
        for network in (built.coarse, built.fine):
            network.density_head.weight.mul_(8.0)
            network.density_head.bias.fill_(-0.3)
        for motion in (built.canonical_motion, built.observed_motion):
            torch.nn.init.normal_(motion.head.weight, std=0.02)
        built.appearance.normal_(std=0.5)
    return built


def boxes():
    points = np.random.default_rng(0).uniform(-0.4, 0.4, (60, 3)) + np.array([0.0, 0.0, 0.9])
    moved = np.stack([points + np.array([0.1 * frame, 0.0, 0.0]) for frame in range(3)]).astype(
        np.float32
    )
    return frame_boxes(moved, np.array([0.0, 0.4, 1.0]), CAMERA, BoxConfig())


def batch(rays: int = 120) -> Batch:
    generator = torch.Generator().manual_seed(1)
    pixel = torch.randint(32 * 32, (rays,), generator=generator)
    through, _ = pixel_rays(CAMERA, pixel)
    row = torch.randint(3, (rays,), generator=generator)
    near, far = boxes().intersect(through, row)
    hit = far > near
    return Batch(
        through,
        rays,
        int(row[0]),
        row,
        torch.where(hit, near, 0.0),
        torch.where(hit, far, 0.0),
        torch.rand(rays, 3, generator=generator),
        torch.ones(rays),
        torch.ones(rays),
        torch.rand(rays, 3, generator=generator),
        torch.rand(rays, COARSE + FINE, generator=generator),
    )


def losses_and_gradients(plain: bool) -> tuple[dict[str, float], dict[str, torch.Tensor]]:
    built, drawn, generator = field(), batch(), torch.Generator().manual_seed(2)
    if plain:
        scene = PlainBoxScene(built, boxes(), COARSE, FINE)
        terms = plain_losses(scene, LOSSES, drawn, generator)
    else:
        objective = NetworkObjective(BoxScene(built, boxes(), COARSE, FINE), LOSSES, True)
        terms = objective(drawn, generator)
    torch.stack(list(terms.values())).sum().backward()
    gradients = {n: p.grad for n, p in built.named_parameters() if p.grad is not None}
    return {name: float(value.detach()) for name, value in terms.items()}, gradients


def test_leaving_out_what_cannot_be_seen_changes_no_loss_and_no_gradient():
    expected, plain = losses_and_gradients(plain=True)
    found, ours = losses_and_gradients(plain=False)
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert value > 1e-3, f"{name} is nothing to compare"
        assert found[name] == pytest.approx(value, rel=1e-5)
    assert ours.keys() == plain.keys()
    for name, gradient in plain.items():
        # Sums over samples in another order, in float32.
        scale = float(gradient.abs().amax()) + 1e-7
        assert torch.allclose(ours[name], gradient, atol=2e-4 * scale), name


def test_the_scene_of_these_tests_has_empty_and_solid_samples_hidden_ones_and_rays_that_miss():
    drawn, scene = batch(), BoxScene(field(), boxes(), COARSE, FINE)
    assert 0.1 < (drawn.far > drawn.near).float().mean() < 0.9
    rendered = scene.render(
        drawn.rays, drawn.row, drawn.near, drawn.far, drawn.background, drawn.jitter
    )
    assert 0.05 < (rendered.density > 0).float().mean() < 0.95
    assert rendered.opacity.amax() > 0.99


def test_rays_that_miss_the_box_show_the_background_exactly():
    drawn, scene = batch(), BoxScene(field(), boxes(), COARSE, FINE)
    rendered = scene.render(
        drawn.rays, drawn.row, drawn.near, drawn.far, drawn.background, drawn.jitter
    )
    missed = drawn.far <= drawn.near
    assert missed.any()
    assert torch.equal(rendered.rgb[missed], drawn.background[missed])
    assert (rendered.opacity[missed] == 0).all()


def test_without_density_every_ray_shows_the_background_and_the_consensus_is_exactly_zero():
    built = field()
    with torch.no_grad():
        built.fine.density_head.bias.fill_(-1e3)
        built.coarse.density_head.bias.fill_(-1e3)
    drawn = batch()
    objective = NetworkObjective(BoxScene(built, boxes(), COARSE, FINE), LOSSES, True)
    rendered = objective.scene.render(
        drawn.rays, drawn.row, drawn.near, drawn.far, drawn.background, drawn.jitter
    )
    assert torch.equal(rendered.rgb, drawn.background)
    terms = objective(drawn, torch.Generator().manual_seed(0))
    assert float(terms["consensus"].detach()) == 0.0
    torch.stack(list(terms.values())).sum().backward()


def test_hidden_points_belong_to_the_consensus():
    # The threshold is on density, so the inside of the body and what it hides count.
    built = field()
    with torch.no_grad():
        built.coarse.density_head.bias.fill_(1e3)
        built.fine.density_head.bias.fill_(1e3)
    drawn = batch()
    scene = BoxScene(built, boxes(), COARSE, FINE)
    rendered = scene.render(
        drawn.rays, drawn.row, drawn.near, drawn.far, drawn.background, drawn.jitter
    )
    last = torch.arange(len(rendered.density)) % (COARSE + FINE) == COARSE + FINE - 1
    assert (rendered.density[last] > 0.01).all()
    gradient = torch.autograd.grad(
        rendered.canonical[last].sum(), list(built.motion_parameters()), allow_unused=True
    )
    assert any(g is not None and g.abs().amax() > 0 for g in gradient)


def test_evaluation_is_deterministic_and_draws_nothing():
    scene = BoxScene(field(), boxes(), COARSE, FINE)
    rays, _ = pixel_rays(CAMERA, torch.arange(32 * 32))
    row = torch.ones(32 * 32, dtype=torch.int64)
    visible = scene.pixels(CAMERA, 1)
    assert len(visible.pixels) == 32 * 32
    near, far = scene.boxes.intersect(rays, row)
    half = torch.full((len(rays), scene.jitters), 0.5)
    state = torch.get_rng_state()
    with torch.no_grad():
        first, second = (
            scene.render(rays, row, near, far, torch.ones(len(rays), 3), half).rgb for _ in range(2)
        )
    assert torch.equal(first, second)
    assert torch.equal(torch.get_rng_state(), state)


def test_rays_do_not_know_of_each_other():
    drawn, scene = batch(), BoxScene(field(), boxes(), COARSE, FINE)
    some = torch.arange(7, 60)
    whole = scene.render(
        drawn.rays, drawn.row, drawn.near, drawn.far, drawn.background, drawn.jitter
    )
    part = scene.render(
        Rays(drawn.rays.origins[some], drawn.rays.directions[some]),
        drawn.row[some],
        drawn.near[some],
        drawn.far[some],
        drawn.background[some],
        drawn.jitter[some],
    )
    assert torch.allclose(part.rgb, whole.rgb[some], atol=1e-5)
