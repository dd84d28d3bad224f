"""Coarse and fine samples along rays, as NeRF takes them.

Source: NeRF (Mildenhall et al. 2020), sec. 5.2. Every sample stands for the stretch of its ray
that is nearer to it than to its neighbours; the stretches fill the ray from near to far, so that
a constant density is rendered exactly and the last step is as finite as the others.
"""

from __future__ import annotations

import torch
from torch import Tensor

# Added to every weight: a ray on which nothing was found is sampled evenly.
_EVEN = 1e-5


def spread_evenly(near: Tensor, far: Tensor, jitter: Tensor) -> Tensor:
    """One distance in each of N equal parts of rays (R,): (R, N) from jitter (R, N) in [0, 1)."""
    count = jitter.shape[1]
    part = torch.arange(count, device=jitter.device, dtype=jitter.dtype)
    return near[:, None] + (far - near)[:, None] * (part + jitter) / count


def borders(distance: Tensor, near: Tensor, far: Tensor) -> Tensor:
    """Borders (R, N + 1) of the samples' stretches: half-way between sorted distances (R, N)."""
    middle = 0.5 * (distance[:, 1:] + distance[:, :-1])
    return torch.cat([near[:, None], middle, far[:, None]], 1)


def draw_where_weight_is(borders: Tensor, weights: Tensor, jitter: Tensor) -> Tensor:
    """Distances (R, M) distributed as the weights (R, N) of the stretches between the borders.

    Args:
        jitter: (R, M) in [0, 1), one for each of M equally likely parts.
    """
    count = jitter.shape[1]
    part = torch.arange(count, device=jitter.device, dtype=jitter.dtype)
    wanted = (part + jitter) / count
    share = weights + _EVEN
    cumulated = torch.cumsum(share / share.sum(1, keepdim=True), 1)
    cumulated = torch.cat([torch.zeros_like(cumulated[:, :1]), cumulated], 1)
    after = torch.searchsorted(cumulated, wanted, right=True).clamp(1, weights.shape[1])
    low, high = cumulated.gather(1, after - 1), cumulated.gather(1, after)
    start, end = borders.gather(1, after - 1), borders.gather(1, after)
    within = ((wanted - low) / (high - low).clamp_min(torch.finfo(low.dtype).tiny)).clamp(0.0, 1.0)
    return start + within * (end - start)
