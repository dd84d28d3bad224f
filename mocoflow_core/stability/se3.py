"""Rigid motion at every angle: the exponential map, its derivative, long chains of it."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.linalg import expm, expm_frechet
from scipy.spatial.transform import Rotation
from torch import Tensor

from mocoflow_core.geometry.se3 import exp_se3, transform_points
from mocoflow_core.stability.case import Case, Found, largest

TINY = (0.0, 1e-38, 1e-30, 1e-20, 1e-12, 1e-8, 1e-6, 1e-4, 1e-3)
SERIES_BORDER = (0.4999999, 0.5, 0.5000001)
TURNS = (math.pi - 1e-6, math.pi, math.pi + 1e-6, 2 * math.pi, 1e2, 1e3)
ANGLES = (*TINY, 0.1, *SERIES_BORDER, 1.0, *TURNS)
BELOW_PI = (0.0, 1e-12, 1e-6, 1e-3, 0.5, 1.0, 3.0, math.pi - 1e-3)

AXIS = torch.tensor([2.0, -3.0, 6.0], dtype=torch.float64) / 7.0
SHIFT = torch.tensor([0.3, -0.7, 1.1], dtype=torch.float64)
POINT = torch.tensor([0.5, 0.2, -0.9], dtype=torch.float64)
SINGLE = torch.finfo(torch.float32).eps
DOUBLE = torch.finfo(torch.float64).eps


def _twist(angle: float, dtype: torch.dtype = torch.float64) -> Tensor:
    return torch.cat([angle * AXIS, SHIFT]).to(dtype)


def _generator(twist: Tensor) -> NDArray[np.float64]:
    x, y, z, *shift = twist.double().tolist()
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    generator[:3, 3] = shift
    return generator


def _jacobian(twist: Tensor) -> Tensor:
    """Derivative (3, 6) of a moved point by the twist."""
    point = POINT.to(twist.dtype)
    found = torch.autograd.functional.jacobian(lambda t: transform_points(t, point), twist)
    assert isinstance(found, Tensor)
    return found


def _against_matrix_exponential(angle: float) -> Found:
    rotation, translation = exp_se3(_twist(angle))
    expected = expm(_generator(_twist(angle)))
    off = max(
        largest(rotation.numpy() - expected[:3, :3]),
        largest(translation.numpy() - expected[:3, 3]),
    )
    return Found(off, (rotation, translation))


def _is_a_rotation(angle: float) -> Found:
    rotation, translation = exp_se3(_twist(angle, torch.float32))
    identity = torch.eye(3)
    off = max(
        largest(rotation @ rotation.T - identity), abs(float(torch.linalg.det(rotation)) - 1.0)
    )
    return Found(off, (rotation, translation))


def _single_against_double(angle: float) -> Found:
    twist = _twist(angle, torch.float32)
    found = transform_points(twist, POINT.float())
    expected = transform_points(twist.double(), POINT.float().double())
    return Found(largest(found.double() - expected), (found,))


def _huge_translation(length: float) -> Found:
    twist = torch.cat([AXIS, length * SHIFT]).float()
    rotation, translation = exp_se3(twist)
    expected_rotation, expected = exp_se3(twist.double())
    off = largest(translation.double() - expected) / length
    return Found(max(off, largest(rotation.double() - expected_rotation)), (rotation, translation))


def _log_round_trip(angle: float) -> Found:
    omega = angle * AXIS
    rotation, _ = exp_se3(torch.cat([omega, SHIFT]))
    log = Rotation.from_matrix(rotation.numpy()).as_rotvec()
    return Found(largest(log - omega.numpy()), (rotation,))


def _composition(steps: float) -> Found:
    small = torch.cat([0.01 * AXIS, 0.01 * SHIFT])
    point = POINT.float()
    for _ in range(int(steps)):
        point = transform_points(small.float(), point)
    expected = transform_points(steps * small.float().double(), POINT.float().double())
    return Found(largest(point.double() - expected), (point,))


def _derivative(angle: float) -> Found:
    twist = _twist(angle)
    found = _jacobian(twist)
    start = np.append(POINT.numpy(), 1.0)
    columns = []
    for unit in torch.eye(6, dtype=torch.float64):
        _, change = expm_frechet(_generator(twist), _generator(unit))
        columns.append((change @ start)[:3])
    return Found(largest(found.numpy() - np.stack(columns, -1)), (found,))


def _derivative_in_single_precision(angle: float) -> Found:
    single = _twist(angle, torch.float32)
    found = _jacobian(single)
    return Found(largest(found.double() - _jacobian(single.double())), (found,))


CASES = (
    Case(
        "exponential",
        "closed forms divide by the angle and by its square",
        "angle, rad",
        ANGLES,
        "matrix exponential, float64",
        _against_matrix_exponential,
        lambda angle: 50 * DOUBLE * (10 + angle),
        "m",
        "rounding; the reference squares its result log2(angle) times and loses as much",
    ),
    Case(
        "stays_a_rotation",
        "rounding of the coefficients shears a rotation",
        "angle, rad",
        ANGLES,
        "R R^T = 1 and det R = 1, float32",
        _is_a_rotation,
        16 * SINGLE,
        "",
        "sixteen roundings: no growth with the angle, as sine and cosine are of size one",
    ),
    Case(
        "single_precision",
        "the squared angle loses digits that sine and cosine need",
        "angle, rad",
        ANGLES,
        "the same in float64",
        _single_against_double,
        lambda angle: SINGLE * (8 + 4 * angle),
        "m",
        "half a rounding of the squared angle is an error of the angle, proportional to it",
    ),
    Case(
        "huge_translation",
        "a long translation swallows the rotation's digits",
        "length, m",
        (1.0, 1e3, 1e6, 1e12, 1e30),
        "the same in float64, relative to the length",
        _huge_translation,
        16 * SINGLE,
        "relative",
        "sixteen roundings; the rotation is computed without the translation",
    ),
    Case(
        "log_undoes_exp",
        "the logarithm is ambiguous from a half turn on",
        "angle, rad",
        BELOW_PI,
        "rotation vector of an independent logarithm, float64",
        _log_round_trip,
        1e-12,
        "rad",
        "near a half turn the axis is read off differences of size (pi - angle): 1e3 roundings",
    ),
    Case(
        "composition",
        "rounding adds up along a chain",
        "steps",
        (1.0, 10.0, 100.0, 1000.0),
        "one exponential of all steps, float64",
        _composition,
        lambda steps: 4 * SINGLE * (1 + steps),
        "m",
        "a few roundings of coordinates of size one to four in each step, all in one direction",
    ),
    Case(
        "derivative",
        "derivatives of the closed forms divide by higher powers of the angle",
        "angle, rad",
        ANGLES,
        "Frechet derivative of the matrix exponential, float64",
        _derivative,
        lambda angle: 50 * DOUBLE * (10 + angle),
        "m/rad",
        "rounding; the reference squares its result log2(angle) times and loses as much",
    ),
    Case(
        "derivative_in_single_precision",
        "differences of nearly equal numbers at small angles",
        "angle, rad",
        (*TINY, 0.01, 0.1, *SERIES_BORDER, 1.0, math.pi),
        "the same in float64",
        _derivative_in_single_precision,
        lambda angle: SINGLE * (16 + 16 * angle),
        "m/rad",
        "some roundings, and the angle's own rounding times the second derivative",
    ),
)
