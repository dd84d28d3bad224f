"""Volume rendering from no density to infinite density, from one sample to a hundred thousand."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from mocoflow_core.rendering.compositing import composite, sum_along_rays
from mocoflow_core.stability.case import Case, Found, largest

SINGLE = torch.finfo(torch.float32).eps
STEP_M = 0.01
DENSITIES = (0.0, 1e-38, 1e-12, 1e-3, 1.0, 1e2, 1e4, 1e6, 1e30, 3.4e38, math.inf)


def _one_ray(density: Tensor, step_m: float = STEP_M) -> tuple[Tensor, Tensor]:
    steps = torch.full_like(density, step_m)
    return composite(density, steps, torch.zeros(len(density), dtype=torch.int64), 1)


def _exact(density: Tensor, step_m: float = STEP_M) -> tuple[np.ndarray, float]:
    """Weights and transmittance of one ray by the definition, in float64."""
    thickness = density.detach().double().numpy() * float(np.float32(step_m))
    ahead = np.concatenate([[0.0], np.cumsum(thickness)])
    return np.exp(-ahead[:-1]) * -np.expm1(-thickness), float(np.exp(-ahead[-1]))


def _against_definition(density: Tensor) -> Found:
    density = density.requires_grad_()
    weights, transmittance = _one_ray(density)
    colour = torch.linspace(0, 1, len(density))
    (weights @ colour + 0.5 * transmittance.sum()).backward()
    expected, left = _exact(density)
    seen, behind = weights.detach().double(), float(transmittance.detach())
    off = max(
        largest(seen.numpy() - expected), abs(behind - left), abs(float(seen.sum()) + behind - 1.0)
    )
    gradient = density.grad
    assert gradient is not None
    return Found(off, (weights, transmittance, gradient))


def _uniform(density: float) -> Found:
    return _against_definition(torch.full((64,), density))


def _one_sample(density: float) -> Found:
    found = _against_definition(torch.tensor([density]))
    weights, _ = _one_ray(torch.tensor([density]))
    expected, _ = _exact(torch.tensor([density]))
    # A faint sample must keep its digits, not only be close to zero; denormals have none.
    scale = max(float(expected[0]), torch.finfo(torch.float32).tiny)
    return Found(max(found.error, abs(float(weights) - float(expected[0])) / scale), found.watched)


def _many_samples(count: float) -> Found:
    generator = torch.Generator().manual_seed(0)
    density = torch.rand(int(count), generator=generator) * (200.0 / count)
    return _against_definition(density)


def _all_in(place: str) -> Found:
    density = torch.zeros(128)
    density[{"first": 0, "middle": 64, "last": -1}[place]] = 1e6
    return _against_definition(density)


def _underflow(thickness: float) -> Found:
    return _against_definition(torch.full((100,), thickness / (100 * STEP_M)))


def _behind_opaque(thickness: float) -> Found:
    """Gradient of the colour by the density behind a front, against its closed form."""
    density = torch.tensor([thickness / STEP_M, 10.0], requires_grad=True)
    weights, _ = _one_ray(density)
    weights[1].backward()
    gradient = density.grad
    assert gradient is not None
    front, back = (density.detach().double() * float(np.float32(STEP_M))).tolist()
    expected = np.array([math.expm1(-back), math.exp(-back)]) * math.exp(-front) * STEP_M
    return Found(largest(gradient.double().numpy() - expected) / STEP_M, (gradient, weights))


def _empty_rays(rays: float) -> Found:
    """Rays without samples between rays with some: they show the background, to the last bit."""
    count = int(rays)
    ray = torch.arange(0, count, 2).repeat_interleave(3)
    weights, transmittance = composite(
        torch.full((len(ray),), 1e6), torch.full((len(ray),), STEP_M), ray, count
    )
    background = torch.rand(count, 3, generator=torch.Generator().manual_seed(0))
    seen = sum_along_rays(weights[:, None] * torch.ones(len(ray), 3), ray, count)
    shown = seen + transmittance[:, None] * background
    return Found(largest(shown[1::2] - background[1::2]), (shown,))


def _after_many_opaque_rays(rays: float) -> Found:
    """A faint ray in one list with opaque ones, whose thickness the running sum carries along."""
    count = int(rays)
    density = torch.full((count,), 1e9)
    density[-1] = 1e-3
    weights, transmittance = composite(
        density, torch.full((count,), STEP_M), torch.arange(count), count
    )
    expected, _ = _exact(density[-1:])
    off = abs(float(weights[-1]) - float(expected[0])) / float(expected[0])
    return Found(off, (weights, transmittance))


_ROUNDINGS = "a few roundings of numbers of size one; sums are kept in float64"

CASES = (
    Case(
        "uniform_density",
        "no density at all, and more than any number can hold",
        "density, 1/m",
        DENSITIES,
        "the definition in float64; weights + transmittance = 1",
        _uniform,
        4 * SINGLE,
        "",
        _ROUNDINGS,
    ),
    Case(
        "one_sample",
        "1 - exp(-x) loses all digits of a small x",
        "density, 1/m",
        DENSITIES,
        "the definition in float64, relative",
        _one_sample,
        4 * SINGLE,
        "relative",
        "a few roundings: expm1 keeps the digits",
    ),
    Case(
        "many_samples",
        "sums of a hundred thousand samples",
        "samples",
        (1.0, 10.0, 1e3, 1e4, 1e5),
        "the definition in float64; weights + transmittance = 1",
        _many_samples,
        4 * SINGLE,
        "",
        _ROUNDINGS,
    ),
    Case(
        "all_density_in",
        "an opaque first sample hides the rest, an opaque last one must not hide the background",
        "place on the ray",
        ("first", "middle", "last"),
        "the definition in float64",
        _all_in,
        4 * SINGLE,
        "",
        _ROUNDINGS,
    ),
    Case(
        "transmittance_underflow",
        "exp(-x) is no number any more from x = 104 on",
        "thickness of the ray",
        (1e-6, 1.0, 80.0, 88.0, 104.0, 1e3, 1e6),
        "the definition in float64",
        _underflow,
        4 * SINGLE,
        "",
        _ROUNDINGS,
    ),
    Case(
        "gradient_behind_opaque",
        "0 times infinity in the chain rule behind an opaque front",
        "thickness of the front",
        (0.0, 1.0, 20.0, 79.0, 80.0, 81.0, 1e3, 1e9),
        "closed form, float64",
        _behind_opaque,
        4 * SINGLE,
        "per unit thickness",
        "a few roundings; the clamp at thickness 80 leaves out gradients below exp(-80)",
    ),
    Case(
        "empty_rays",
        "rays that no sample belongs to, between opaque ones",
        "rays",
        (1.0, 2.0, 3.0, 1e3, 1e5),
        "the background itself",
        _empty_rays,
        0.0,
        "",
        "exact: nothing may be added to what nothing covers",
    ),
    Case(
        "after_opaque_rays",
        "one running sum goes over all rays, and a faint ray comes after opaque ones",
        "rays",
        (1.0, 1e2, 1e4, 1e6),
        "the faint ray alone, float64, relative",
        _after_many_opaque_rays,
        lambda rays: 4 * SINGLE + 80 * rays * torch.finfo(torch.float64).eps,
        "relative",
        "the running sum is at most 80 a ray, and rounded in float64",
    ),
)
