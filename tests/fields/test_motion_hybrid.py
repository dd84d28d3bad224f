from __future__ import annotations

import pytest
import torch

from mocoflow_core.fields.motion_hybrid import HybridMotion, Moments, interpolate_rows
from mocoflow_core.fields.motion_residual import ResidualConfig
from tests.rigid_figures import MOTIONS, near_surface, rigid_figure, rows, single


@pytest.fixture(scope="module")
def rigid():
    return rigid_figure()


def motion(rigid) -> HybridMotion:
    torch.manual_seed(0)
    return HybridMotion(rigid.body.times, torch.zeros(3), 0.5, ResidualConfig(hidden=16))


def test_the_start_is_the_body_s_own_motion(rigid):
    field = motion(rigid)
    moments = Moments(rigid.body, field.codes)
    points = single(near_surface(rigid.mesh, 0.05))
    for row in range(len(MOTIONS)):
        frame = rows(len(points), row)
        placed, known = field.to_observed(points, frame, moments)
        expected, _ = rigid.body.to_observed(points, frame)
        assert known.all()
        # The zero residual passes through coordinates about the centre: rounding remains.
        assert (placed - expected).abs().max() < 2e-6
        back = field.to_canonical(expected, frame, moments)
        assert (back - rigid.body.to_canonical(expected, frame)[0]).abs().max() < 2e-6


def test_the_residual_corrects_what_the_body_says(rigid):
    field = motion(rigid)
    with torch.no_grad():
        field.residual_to_canonical.network[-1].bias[3:] = torch.tensor([0.1, 0.0, 0.0])
    moments = Moments(rigid.body, field.codes)
    points = single(near_surface(rigid.mesh, 0.05))
    shift = field.correct(points, rows(len(points), 1), moments) - points
    # A twist in units of the radius, 0.5 m.
    assert shift.detach().numpy() == pytest.approx(
        torch.tensor([[0.05, 0, 0]] * len(points)), abs=1e-6
    )


def test_both_directions_learn_from_the_start(rigid):
    field = motion(rigid)
    moments = Moments(rigid.body, field.codes)
    points = single(near_surface(rigid.mesh, 0.05))
    frame = rows(len(points), 1)
    placed, _ = field.to_observed(points, frame, moments)
    (field.to_canonical(placed, frame, moments) - points + 0.01).square().sum().backward()
    for name, parameter in field.named_parameters():
        assert torch.isfinite(parameter.grad).all(), name
    assert field.residual_to_canonical.network[-1].bias.grad.abs().max() > 0
    assert field.residual_to_observed.network[-1].bias.grad.abs().max() > 0


def test_rows_are_linear_between_frames_and_exact_at_them():
    values = torch.tensor([[0.0, 1.0], [2.0, -1.0], [3.0, 5.0]])
    at = torch.tensor([0.0, 0.5, 1.0], dtype=torch.float64)
    assert torch.equal(interpolate_rows(values, at, at), values)
    between = interpolate_rows(values, at, torch.tensor([0.25, 0.9]))
    assert between.flatten().tolist() == pytest.approx([1.0, 0.0, 2.8, 3.8])


def test_times_beyond_the_clip_take_its_ends_and_one_frame_serves_all():
    values = torch.tensor([[0.0], [2.0]])
    at = torch.tensor([0.2, 0.8], dtype=torch.float64)
    assert interpolate_rows(values, at, torch.tensor([-1.0, 0.1, 0.9, 7.0])).flatten().tolist() == (
        [0.0, 0.0, 2.0, 2.0]
    )
    alone = interpolate_rows(values[:1], at[:1], torch.tensor([0.0, 0.5, 1.0]))
    assert torch.equal(alone, torch.zeros(3, 1))
