"""Samples along rays, packed: only where the body can be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from pydantic import Field
from torch import Tensor

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.geometry.rays import Rays


class SamplingConfig(ConfigurationPart):
    """Where rays are sampled."""

    step_m: float = Field(0.01, gt=0, description="distance between samples, metres")
    inner_depth_m: float = Field(
        0.04, gt=0, description="samples deeper under the canonical skin are never visible"
    )


@dataclass(frozen=True, eq=False)
class PackedSamples:
    """S samples of R rays in one list, sorted by ray and distance."""

    points: Tensor  # (S, 3) world metres, observed space
    ray: Tensor  # (S,) int64
    step_m: Tensor  # (S,)

    def select(self, keep: Tensor) -> PackedSamples:
        return PackedSamples(self.points[keep], self.ray[keep], self.step_m[keep])

    def __len__(self) -> int:
        return len(self.ray)


def march(
    rays: Rays,
    near: Tensor,
    far: Tensor,
    step_m: float,
    jitter: Tensor,
    keep: Callable[[Tensor, Tensor], Tensor],
) -> PackedSamples:
    """Samples at regular steps between near and far, kept where ``keep`` says so.

    Args:
        near, far: (R,) metres; a ray with ``far <= near`` gets no samples.
        jitter: (R,) in [0, 1): where in its step the first sample lies; 0.5 is deterministic.
        keep: maps points (P, 3) and their rays (P,) to a mask (P,).
    """
    length = (far - near).clamp_min(0.0)
    count = torch.ceil(length / step_m).long()
    ray = torch.repeat_interleave(torch.arange(len(rays), device=near.device), count)
    first = torch.cumsum(count, 0) - count
    position = torch.arange(len(ray), device=near.device) - first[ray]
    distance = near[ray] + (position + jitter[ray]) * step_m
    points = rays.origins[ray] + distance[:, None] * rays.directions[ray]
    kept = keep(points, ray).nonzero()[:, 0]
    return PackedSamples(points[kept], ray[kept], torch.full_like(distance[kept], step_m))
