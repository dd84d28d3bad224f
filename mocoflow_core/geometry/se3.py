"""Rigid motion as twists: the exponential map, exact and differentiable at every angle.

A twist is ``(omega, v)``: rotation vector in radians and translation part in metres. Shapes are
``(..., 6)`` and broadcast over the leading axes.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

# Below this squared angle the coefficients come from their Taylor series: the closed forms cancel
# there, and their derivatives divide by zero at zero.
_SERIES_BELOW = 0.25
# Terms after which the series is exact to rounding below that angle: 0.25^n / (2n + 1)!.
_SERIES_TERMS = {torch.float64: 8}
_FEW_TERMS = 4


def _series(squared_angle: Tensor) -> Tensor:
    """The three coefficients (..., 3) by Horner's rule: ``sum_k (-s)^k / (j + 2k)!``, j = 1..3."""
    result = squared_angle.new_zeros(3)
    for k in reversed(range(_SERIES_TERMS.get(squared_angle.dtype, _FEW_TERMS))):
        inverse = [1.0 / math.factorial(j + 2 * k) for j in (1, 2, 3)]
        result = squared_angle.new_tensor(inverse) - result * squared_angle
    return result


def _coefficients(squared_angle: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """``sin(a)/a``, ``(1 - cos a)/a^2`` and ``(a - sin a)/a^3``, smooth in ``a^2`` (..., 1).

    Both branches of the ``where`` stay finite, so that no NaN enters the gradient.
    """
    small = squared_angle < _SERIES_BELOW
    series = _series(torch.where(small, squared_angle, 0.0))
    safe = torch.where(small, 1.0, squared_angle)
    angle = safe.sqrt()
    sine, half_sine = torch.sin(angle), torch.sin(0.5 * angle)
    closed = torch.cat(
        [sine / angle, 2.0 * half_sine * half_sine / safe, (angle - sine) / (angle * safe)], -1
    )
    a, b, c = torch.where(small, series, closed).split(1, -1)
    return a, b, c


def _cross(a: Tensor, b: Tensor) -> Tensor:
    # linalg.cross broadcasts sizes, but wants the same number of axes.
    return torch.linalg.cross(*torch.broadcast_tensors(a, b), dim=-1)


def transform_points(twist: Tensor, points: Tensor) -> Tensor:
    """Apply ``exp(twist)`` to points.

    Args:
        twist: (..., 6), ``(omega, v)`` in radians and metres.
        points: (..., 3) metres.

    Returns:
        (..., 3) metres. A zero twist is the identity, with the exact derivative ``v + omega x p``.

    Source: Modern Robotics, eqs. 3.51 and 3.88; MoCo-Flow sec. 3.2 (SE(3) motion fields).
    """
    # Autocast makes twists shorter than points: a rotation needs the digits of the longer type.
    wide = torch.promote_types(torch.promote_types(twist.dtype, points.dtype), torch.float32)
    twist, points = twist.to(wide), points.to(wide)
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
    omega, v = twist.split(3, -1)
    basis = torch.eye(3, dtype=twist.dtype, device=twist.device)
    # Turned without translation: subtracting a long one would cost digits.
    turning = torch.cat([omega, torch.zeros_like(v)], -1)
    columns = transform_points(turning[..., None, :], basis)
    return columns.transpose(-1, -2), transform_points(twist, torch.zeros_like(v))
