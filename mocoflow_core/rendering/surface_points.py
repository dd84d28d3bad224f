"""Where rays meet the surface: the points at which their opacity passes one half."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.rendering.compositing import sum_along_rays
from mocoflow_core.rendering.posed_scene import RenderedRays
from mocoflow_core.rendering.trained_scene import TrainedScene, render_pixels

HALF_OPAQUE = math.log(2.0)  # exp(-thickness) = 1 / 2


@torch.no_grad()
def surface_points(scene: TrainedScene, camera: Camera, time: float) -> NDArray[np.float64]:
    """World points (N, 3), metres, that the pixels of a camera see at a normalised time.

    Pixels whose whole ray stays below an opacity of one half see nothing.
    """
    posed = scene.at(time)
    visible = posed.pixels(camera, 0)
    found = []
    for chunk in torch.arange(len(visible.pixels)).split(posed.rays_at_once):
        rays, rendered = render_pixels(
            posed, camera, visible.select(chunk), torch.ones(len(chunk), 3)
        )
        found.append(half_opaque_points(rendered, rays.directions))
    return torch.cat(found).double().numpy() if found else np.empty((0, 3))


def half_opaque_points(rendered: RenderedRays, directions: Tensor) -> Tensor:
    """The crossing of each ray that has one, (N, 3), exact within its step.

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
    return samples.points[crossing] + along * directions[samples.ray[crossing]]
