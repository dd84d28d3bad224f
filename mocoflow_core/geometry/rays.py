"""Viewing rays of a camera, and where they cross a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from mocoflow_core.geometry.camera import Camera


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays in world space. Directions have unit length, so distances are metres."""

    origins: Tensor  # (R, 3)
    directions: Tensor  # (R, 3)

    def __len__(self) -> int:
        return self.origins.shape[0]

    def at(self, distance_m: Tensor) -> Tensor:
        """Points at the given distances (R,) along the rays, (R, 3)."""
        return self.origins + distance_m[:, None] * self.directions

    def to(self, device: torch.device) -> Rays:
        return Rays(self.origins.to(device), self.directions.to(device))

    def select(self, rows: Tensor | slice) -> Rays:
        return Rays(self.origins[rows], self.directions[rows])


def pixel_rays(camera: Camera, pixels: Tensor) -> tuple[Rays, Tensor]:
    """Rays through the centres of pixels.

    Args:
        camera: a pinhole (distortion already removed).
        pixels: (R,) flat row-major pixel indices.

    Returns:
        the rays, and the distance (R,) along each for one metre of depth along the viewing axis.
    """
    x = (pixels % camera.width) + 0.5
    y = torch.div(pixels, camera.width, rounding_mode="floor") + 0.5
    # The inverse intrinsics and the rotation are combined in float64: they are tiny.
    inverse = torch.from_numpy(camera.R.T @ np.linalg.inv(camera.K)).to(pixels.device)
    homogeneous = torch.stack([x, y, torch.ones_like(x)], -1).double()
    directions = homogeneous @ inverse.T
    along = directions.norm(dim=-1)
    centre = torch.from_numpy(camera.centre_world).to(directions)
    rays = Rays(centre.expand_as(directions).float(), (directions / along[:, None]).float())
    return rays, along.float()


def intersect_boxes(rays: Rays, lower: Tensor, upper: Tensor) -> tuple[Tensor, Tensor]:
    """Entry and exit distance of each ray through its box, by slabs (never one pair per image).

    Args:
        lower, upper: (R, 3) or (3,) corners of axis-aligned boxes, world metres.

    Returns:
        ``near`` and ``far`` (R,) metres with ``far <= near`` where the ray misses. ``near`` is not
        negative, so a camera inside the box starts at itself. A ray parallel to a slab is inside
        it for all distances or for none.
    """
    direction = rays.directions
    parallel = direction == 0
    safe = torch.where(parallel, torch.ones_like(direction), direction)
    first = (lower - rays.origins) / safe
    second = (upper - rays.origins) / safe
    inside = (rays.origins >= lower) & (rays.origins <= upper)
    infinity = torch.full_like(direction, torch.inf)
    near = torch.where(parallel, torch.where(inside, -infinity, infinity), first.minimum(second))
    far = torch.where(parallel, torch.where(inside, infinity, -infinity), first.maximum(second))
    return near.amax(-1).clamp_min(0.0), far.amin(-1)
