"""Volume rendering of packed samples: weights, transmittance, sums along rays.

S samples of R rays lie in one list, sorted by ray and by distance along it.
"""

from __future__ import annotations

import torch
from torch import Tensor

# exp(-80) is 1.8e-35: no colour survives a thicker sample, and sums of clamped values stay exact.
_OPAQUE = 80.0


def composite(density: Tensor, step_m: Tensor, ray: Tensor, rays: int) -> tuple[Tensor, Tensor]:
    """Weights of the samples and what is left of each ray behind them.

    ``w_i = T_i (1 - exp(-density_i step_i))``, ``T_i = exp(-sum_{j<i} density_j step_j)``. The
    weights of a ray and its transmittance sum to one; a ray without samples is all background.

    Args:
        density: (S,) per metre, not negative.
        step_m: (S,) metres.
        ray: (S,) ray of each sample, ascending.
        rays: number of rays R.

    Returns:
        weights (S,) and transmittance (R,).
    """
    # The running sum goes over all rays, so it is kept in float64.
    thickness = (density * step_m).clamp(max=_OPAQUE).double()
    total = torch.zeros(rays, dtype=thickness.dtype, device=density.device)
    total = total.index_add(0, ray, thickness)
    running = torch.cumsum(thickness, 0) - thickness
    before_ray = torch.cumsum(total, 0) - total
    ahead = (running - before_ray[ray]).clamp_min(0.0)
    weights = torch.exp(-ahead) * -torch.expm1(-thickness)
    return weights.to(density.dtype), torch.exp(-total).to(density.dtype)


def sum_along_rays(values: Tensor, ray: Tensor, rays: int) -> Tensor:
    """Add up the values (S, ...) of each ray's samples, (R, ...)."""
    result = torch.zeros((rays, *values.shape[1:]), dtype=values.dtype, device=values.device)
    return result.index_add(0, ray, values)


def running_count(flags: Tensor, ray: Tensor, rays: int) -> Tensor:
    """How many of a ray's samples up to and including each one (S,) carry the flag."""
    running = torch.cumsum(flags, 0)
    total = torch.zeros(rays, dtype=running.dtype, device=flags.device).index_add(
        0, ray, flags.to(running.dtype)
    )
    return running - (torch.cumsum(total, 0) - total)[ray]
