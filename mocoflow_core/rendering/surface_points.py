"""Where rays meet the surface: the points at which their opacity passes one half."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.rendering.compositing import sum_along_rays
from mocoflow_core.rendering.posed_scene import RenderedRays
from mocoflow_core.rendering.trained_scene import TrainedScene, render_pixels

HALF_OPAQUE = math.log(2.0)  # exp(-thickness) = 1 / 2


class SeenSurface(NamedTuple):
    """What the N pixels of a camera that see the surface see of it."""

    points: NDArray[np.float64]  # (N, 3) world metres
    pixels: NDArray[np.int64]  # (N,) flat indices, ascending


@torch.no_grad()
def surface_points(scene: TrainedScene, camera: Camera, time: float) -> SeenSurface:
    """The surface that a camera sees at a normalised time.

    Pixels whose whole ray stays below an opacity of one half see nothing.
    """
    posed = scene.at(time)
    visible = posed.pixels(camera, 0)
    points, pixels = [torch.empty(0, 3)], [torch.empty(0, dtype=torch.int64)]
    for chunk in torch.arange(len(visible.pixels)).split(posed.rays_at_once):
        rays, rendered = render_pixels(
            posed, camera, visible.select(chunk), torch.ones(len(chunk), 3)
        )
        found, ray = half_opaque_points(rendered, rays.directions)
        points.append(found)
        pixels.append(visible.pixels[chunk[ray]])
    return SeenSurface(torch.cat(points).double().numpy(), torch.cat(pixels).numpy())


def half_opaque_points(rendered: RenderedRays, directions: Tensor) -> tuple[Tensor, Tensor]:
    """The crossing of each ray that has one, (N, 3), exact within its step; and its ray (N,).

    A sample stands in the middle of its step, over which the density is constant.
    """
    samples, rays = rendered.samples, len(directions)
    thickness = (rendered.density * samples.step_m).double()
    total = sum_along_rays(thickness, samples.ray, rays)
    before_ray = torch.cumsum(total, 0) - total
    behind = torch.cumsum(thickness, 0) - before_ray[samples.ray]
    ahead = behind - thickness
    crossing = (ahead < HALF_OPAQUE) & (behind >= HALF_OPAQUE)
    share = (HALF_OPAQUE - ahead[crossing]) / thickness[crossing]
    along = ((share - 0.5) * samples.step_m[crossing])[:, None].to(directions.dtype)
    ray = samples.ray[crossing]
    return samples.points[crossing] + along * directions[ray], ray
