"""Rigid motion as twists: the exponential map, exact and differentiable at every angle.

A twist is ``(omega, v)``: rotation vector in radians and translation part in metres. Shapes are
``(..., 6)`` and broadcast over the leading axes.
"""

from __future__ import annotations

import torch
from torch import Tensor

# Below this squared angle the coefficients come from their Taylor series: the closed forms cancel
# there, and their derivatives divide by zero at zero. Eight terms are exact in float64.
_SERIES_BELOW = 0.25
_SERIES_TERMS = 8


def _series(squared_angle: Tensor, first_factorial: int) -> Tensor:
    """Sum over k of ``(-s)^k / (first_factorial + 2k)!`` by Horner's rule."""
    result = torch.zeros_like(squared_angle)
    for k in reversed(range(_SERIES_TERMS)):
        factorial = 1.0
        for factor in range(2, first_factorial + 2 * k + 1):
            factorial *= factor
        result = result * -squared_angle + 1.0 / factorial
    return result


def _coefficients(squared_angle: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """``sin(a)/a``, ``(1 - cos a)/a^2`` and ``(a - sin a)/a^3``, smooth in ``a^2``.

    Both branches of each ``where`` stay finite, so that no NaN enters the gradient.
    """
    small = squared_angle < _SERIES_BELOW
    for_series = torch.where(small, squared_angle, torch.zeros_like(squared_angle))
    for_closed = torch.where(small, torch.ones_like(squared_angle), squared_angle)
    angle = for_closed.sqrt()
    sine = torch.sin(angle)
    half_sine = torch.sin(0.5 * angle)
    closed = (
        sine / angle,
        2.0 * half_sine * half_sine / for_closed,
        (angle - sine) / (angle * for_closed),
    )
    a, b, c = (
        torch.where(small, _series(for_series, order), value)
        for order, value in zip((1, 2, 3), closed, strict=True)
    )
    return a, b, c


def _cross(a: Tensor, b: Tensor) -> Tensor:
    return torch.linalg.cross(a, b, dim=-1)


def transform_points(twist: Tensor, points: Tensor) -> Tensor:
    """Apply ``exp(twist)`` to points.

    Args:
        twist: (..., 6), ``(omega, v)`` in radians and metres.
        points: (..., 3) metres.

    Returns:
        (..., 3) metres. A zero twist is the identity, with the exact derivative ``v + omega x p``.

    Source: Modern Robotics, eqs. 3.51 and 3.88; MoCo-Flow sec. 3.2 (SE(3) motion fields).
    """
    omega, v = twist[..., :3], twist[..., 3:]
    a, b, c = _coefficients((omega * omega).sum(-1, keepdim=True))
    turned = _cross(omega, points)
    shifted = _cross(omega, v)
    return (
        points
        + a * turned
        + b * _cross(omega, turned)
        + v
        + b * shifted
        + c * _cross(omega, shifted)
    )


def exp_se3(twist: Tensor) -> tuple[Tensor, Tensor]:
    """The exponential map as rotation matrix (..., 3, 3) and translation (..., 3)."""
    basis = torch.eye(3, dtype=twist.dtype, device=twist.device)
    translation = transform_points(twist, torch.zeros_like(twist[..., :3]))
    columns = transform_points(twist[..., None, :], basis) - translation[..., None, :]
    return columns.transpose(-1, -2), translation
