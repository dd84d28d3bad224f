from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.scene_shape import MotionConfig, SceneShape
from tests.rigid_figures import ellipsoid, near_surface, prior_of, single

CONFIGURATION = CanonicalConfig(finest_m=0.02, levels=2)


@pytest.fixture(scope="module")
def prior():
    return prior_of(ellipsoid())


def scene_field(prior, light: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> HybridField:
    torch.manual_seed(0)
    shape = SceneShape(
        canonical=CONFIGURATION,
        motion=MotionConfig(),
        times=(0.0, 0.5, 1.0),
        shell_width_m=0.06,
        inner_depth_m=0.04,
        step_m=0.02,
        light=light,
    )
    return shape.build(prior)


def points(within_m: float = 0.05) -> torch.Tensor:
    return single(near_surface(ellipsoid(), within_m))


def asked(field: HybridField, where: torch.Tensor, facing: tuple[float, ...] = (0.0, 0.0, 1.0)):
    code = torch.zeros(len(where), CONFIGURATION.appearance_width)
    return field.canonical(where, code, torch.tensor(facing).expand(len(where), 3))


def test_density_is_positive_bounded_and_falls_with_the_signed_distance(prior):
    field = scene_field(prior)
    distance = torch.linspace(-0.3, 0.3, 2001)
    density = field.canonical.density(distance).detach()
    deepest = field.canonical.density(torch.tensor([-1e3])).detach()
    assert (density > 0).all()
    assert (density <= deepest).all()
    assert torch.isfinite(deepest).all()
    assert (density.diff() <= 0).all()
    middle = field.canonical.density(torch.zeros(1)).detach()
    assert float(middle / deepest) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("log_sharpness", [-200.0, -30.0, -5.0, 0.0])
def test_density_and_gradient_are_finite_at_any_distance_and_sharpness(prior, log_sharpness):
    canonical = scene_field(prior).canonical
    with torch.no_grad():
        canonical.log_sharpness.fill_(log_sharpness)
    distance = torch.tensor([-1e6, -10.0, -1e-3, 0.0, 1e-30, 1e-3, 10.0, 1e6], requires_grad=True)
    density = canonical.density(distance)
    density.sum().backward()
    assert torch.isfinite(density).all()
    assert (density >= 0).all()
    assert torch.isfinite(distance.grad).all()
    assert torch.isfinite(canonical.log_sharpness.grad)


def test_the_start_is_the_mesh(prior):
    field = scene_field(prior)
    where = points()
    rgb, density, offset = asked(field, where)
    assert torch.equal(offset, torch.zeros(len(where)))
    assert torch.equal(density, field.canonical.density(prior(where)))
    assert ((rgb >= 0) & (rgb <= 1)).all()


def test_the_surface_moves_at_most_as_far_as_it_may(prior):
    field = scene_field(prior)
    with torch.no_grad():
        for parameter in field.canonical.parameters():
            parameter.add_(3.0 * torch.randn_like(parameter))
    rgb, density, offset = asked(field, points())
    assert (offset.abs() <= CONFIGURATION.largest_offset_m).all()
    assert offset.abs().max() > 0.01
    assert torch.isfinite(density).all()
    assert ((rgb >= 0) & (rgb <= 1)).all()


def test_features_exist_wherever_the_shell_asks(prior):
    field = scene_field(prior)
    features = field.canonical.features(points(within_m=0.04))
    assert (features != 0).all(-1).all()


def test_points_far_from_the_body_have_no_density_and_finite_gradients(prior):
    field = scene_field(prior)
    far = torch.tensor([[5.0, 0, 0], [-1e4, 1e4, 0], [0, 0, 1e8]], requires_grad=True)
    rgb, density, _ = asked(field, far)
    assert density.detach().numpy() == pytest.approx(0, abs=1e-4)
    (density.sum() + rgb.sum()).backward()
    assert torch.isfinite(far.grad).all()
    for name, parameter in field.canonical.named_parameters():
        assert parameter.grad is None or torch.isfinite(parameter.grad).all(), name


def test_colour_and_offset_can_learn_from_the_start(prior):
    field = scene_field(prior)
    rgb, density, _ = asked(field, points())
    (rgb.sum() + 1e-3 * density.sum()).backward()
    for table in field.canonical.tables:
        assert torch.isfinite(table.grad).all()
        assert table.grad.abs().max() > 0


def test_without_light_colours_do_not_depend_on_where_surfaces_face(prior):
    field = scene_field(prior)
    up, down = (asked(field, points(), (0.0, 0.0, sign))[0] for sign in (1.0, -1.0))
    assert torch.equal(up, down)


def test_surfaces_that_face_the_light_are_brighter(prior):
    field = scene_field(prior, light=(0.0, 0.0, 0.6))
    up, side, down = (
        asked(field, points(), facing)[0]
        for facing in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    )
    assert (up > side).all()
    assert (side > down).all()
    assert ((up <= 1) & (down >= 0)).all()


def test_the_same_seed_builds_the_same_field(prior):
    first, second = scene_field(prior), scene_field(prior)
    for ours, theirs in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(ours, theirs)


def test_appearance_starts_the_same_for_every_image_and_follows_the_time(prior):
    field = scene_field(prior)
    assert not field.appearance.any()
    with torch.no_grad():
        field.appearance[:, 0] = torch.tensor([1.0, 2.0, 4.0])
    codes = field.appearance_at(torch.tensor([0.0, 0.25, 1.0]))
    assert codes[:, 0].tolist() == pytest.approx([1.0, 1.5, 4.0])


def test_every_encoding_follows_band_alpha(prior):
    field = scene_field(prior)
    where = points()
    code = field.motion.codes[:1].expand(len(where), -1)
    residual = field.motion.residual_to_canonical
    with torch.no_grad():
        residual.network[-1].weight.normal_()
    field.anneal(0.0)
    coarse = residual(where, code)
    field.anneal(float(residual.encoding.bands))
    assert not torch.equal(coarse, residual(where, code))


def test_the_shape_survives_its_file(prior, tmp_path):
    shape = SceneShape(
        canonical=CONFIGURATION,
        motion=MotionConfig(),
        times=tuple(np.linspace(0, 1, 7).tolist()),
        shell_width_m=0.06,
        inner_depth_m=0.04,
        step_m=0.02,
    )
    assert SceneShape.model_validate_json(shape.model_dump_json()) == shape
