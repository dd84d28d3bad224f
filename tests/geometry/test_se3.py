from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from scipy.linalg import expm

from mocoflow_core.geometry.se3 import exp_se3, transform_points

TINY = [0.0, 1e-38, 1e-30, 1e-20, 1e-12, 1e-8, 1e-6, 1e-4, 1e-3]
AROUND_THE_SERIES = [0.4999999, 0.5, 0.5000001]
TURNS = [math.pi - 1e-6, math.pi, math.pi + 1e-6, 2 * math.pi, 1e3]
ANGLES = [*TINY, 0.1, *AROUND_THE_SERIES, 1.0, *TURNS]

AXIS = torch.tensor([2.0, -3.0, 6.0], dtype=torch.float64) / 7.0
SHIFT = torch.tensor([0.3, -0.7, 1.1], dtype=torch.float64)
POINT = torch.tensor([0.5, 0.2, -0.9], dtype=torch.float64)


def twist(angle: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return torch.cat([angle * AXIS, SHIFT]).to(dtype)


def exponential(values: torch.Tensor) -> np.ndarray:
    """The matrix exponential of a twist, by an algorithm that knows nothing of angles."""
    x, y, z, *shift = values.double().tolist()
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    generator[:3, 3] = shift
    return expm(generator)


def jacobian(values: torch.Tensor) -> torch.Tensor:
    point = POINT.to(values.dtype)
    return torch.autograd.functional.jacobian(lambda t: transform_points(t, point), values)


def test_a_zero_twist_is_the_identity_exactly():
    points = torch.randn(5, 3, generator=torch.Generator().manual_seed(0))
    assert torch.equal(transform_points(torch.zeros(6), points), points)
    rotation, translation = exp_se3(torch.zeros(6))
    assert torch.equal(rotation, torch.eye(3))
    assert torch.equal(translation, torch.zeros(3))


def test_at_zero_the_derivative_is_the_infinitesimal_motion():
    found = jacobian(torch.zeros(6, dtype=torch.float64))
    x, y, z = POINT.tolist()
    by_omega = torch.tensor([[0, z, -y], [-z, 0, x], [y, -x, 0]], dtype=torch.float64)
    assert torch.equal(found, torch.cat([by_omega, torch.eye(3, dtype=torch.float64)], 1))


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-4, *AROUND_THE_SERIES, *TURNS])
def test_gradients_are_those_of_finite_differences(angle):
    values = twist(angle).requires_grad_()
    points = POINT.clone().requires_grad_()
    assert torch.autograd.gradcheck(transform_points, (values, points))


@pytest.mark.parametrize("angle", ANGLES)
def test_the_matrix_exponential_is_met_at_every_angle(angle):
    rotation, translation = exp_se3(twist(angle))
    expected = exponential(twist(angle))
    # expm squares its result about log2(angle) times; rounding grows with the angle.
    tolerance = 1e-14 * (10 + angle)
    assert rotation.numpy() == pytest.approx(expected[:3, :3], abs=tolerance)
    assert translation.numpy() == pytest.approx(expected[:3, 3], abs=tolerance)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("angle", ANGLES)
def test_every_group_element_is_a_rotation_of_determinant_one(angle, dtype):
    rotation, translation = exp_se3(twist(angle, dtype))
    rounding = 16 * torch.finfo(dtype).eps
    # Nothing but rounding of sine and cosine: no growth with the angle.
    assert (rotation @ rotation.T - torch.eye(3, dtype=dtype)).abs().max() < rounding
    assert abs(torch.linalg.det(rotation) - 1) < rounding
    assert torch.isfinite(translation).all()


@pytest.mark.parametrize("angle", ANGLES)
def test_single_precision_stays_near_double_precision(angle):
    single = twist(angle, torch.float32)
    points = POINT.float()
    found = transform_points(single, points).double()
    expected = transform_points(single.double(), points.double())
    # Rounding of the squared angle is an angle error of half its relative rounding.
    tolerance = torch.finfo(torch.float32).eps * (8 + 4 * angle)
    assert (found - expected).abs().max() < tolerance


def test_value_and_derivative_go_through_the_series_border_without_a_step():
    for angle in np.linspace(0.3, 0.8, 401):
        single = twist(float(angle), torch.float32)
        value = transform_points(single, POINT.float()).double()
        assert value == pytest.approx(transform_points(single.double(), POINT), abs=1e-6)
        assert (jacobian(single).double() - jacobian(single.double())).abs().max() < 1e-5


@pytest.mark.parametrize("angle", TINY)
def test_tiny_angles_move_points_to_first_order_and_have_finite_gradients(angle):
    values = twist(angle, torch.float32).requires_grad_()
    moved = transform_points(values, POINT.float())
    moved.sum().backward()
    omega, v = values.detach().double().split(3)
    first_order = POINT + v + torch.linalg.cross(omega, POINT + 0.5 * v)
    # What is left out is of second order in the angle.
    assert moved.detach().numpy() == pytest.approx(first_order.numpy(), abs=1e-6 + angle**2)
    assert torch.isfinite(values.grad).all()


@pytest.mark.parametrize("angle", [*TINY, 0.01, 0.1])
def test_the_derivative_keeps_its_digits_at_small_angles(angle):
    single = twist(angle, torch.float32)
    # The closed forms would lose their digits in differences of nearly equal numbers.
    assert (jacobian(single).double() - jacobian(single.double())).abs().max() < 1e-6


def test_the_negative_twist_is_the_inverse():
    values = torch.randn(50, 6, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    points = torch.randn(50, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    back = transform_points(-values, transform_points(values, points))
    assert back.numpy() == pytest.approx(points.numpy(), abs=1e-13)


def test_a_thousand_small_steps_along_one_twist_are_one_large_step():
    values = twist(2.5)
    points = POINT
    for _ in range(1000):
        points = transform_points(values / 1000, points)
    assert points.numpy() == pytest.approx(transform_points(values, POINT).numpy(), abs=1e-11)


def test_distances_between_points_do_not_change():
    values = twist(4.0)
    points = torch.randn(20, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    moved = transform_points(values, points)
    assert torch.pdist(moved).numpy() == pytest.approx(torch.pdist(points).numpy(), abs=1e-13)


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_matrices_and_points_agree_in_any_batch_shape(batch):
    generator = torch.Generator().manual_seed(4)
    values = torch.randn(*batch, 6, generator=generator, dtype=torch.float64)
    rotation, translation = exp_se3(values)
    assert rotation.shape == (*batch, 3, 3)
    moved = (rotation @ POINT) + translation
    assert moved.numpy() == pytest.approx(transform_points(values, POINT.expand(*batch, 3)).numpy())


def test_huge_translations_do_not_disturb_the_rotation():
    values = torch.cat([0.7 * AXIS, 1e6 * SHIFT])
    rotation, translation = exp_se3(values)
    expected = exponential(values)
    assert rotation.numpy() == pytest.approx(expected[:3, :3], abs=1e-14)
    assert translation.numpy() == pytest.approx(expected[:3, 3], rel=1e-13)


@pytest.mark.parametrize("short", [torch.bfloat16, torch.float16])
def test_a_twist_shorter_than_its_points_moves_them_with_the_points_digits(short):
    twisted = twist(1.0).to(short)
    found = transform_points(twisted, POINT.float())
    assert found.dtype == torch.float32
    # The twist is what it is; nothing is lost besides.
    expected = transform_points(twisted.double(), POINT.float().double())
    assert (found.double() - expected).abs().max() < 8 * torch.finfo(torch.float32).eps
