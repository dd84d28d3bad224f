"""Where rays meet the surface: the points at which their opacity passes one half."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import pixel_rays
from mocoflow_core.rendering.compositing import sum_along_rays
from mocoflow_core.rendering.pixels import shell_pixels
from mocoflow_core.rendering.renderer import RenderedRays, render_rays
from mocoflow_core.rendering.trained_scene import TrainedScene

HALF_OPAQUE = math.log(2.0)  # exp(-thickness) = 1 / 2
_RAYS_AT_ONCE = 16_384


@torch.no_grad()
def surface_points(scene: TrainedScene, camera: Camera, time: float) -> NDArray[np.float64]:
    """World points (N, 3), metres, that the pixels of a camera see at a normalised time.

    Pixels whose whole ray stays below an opacity of one half see nothing.
    """
    moments = scene.moments(time)
    appearance = scene.field.appearance_at(torch.tensor([time]))
    shell = shell_pixels(camera, moments.body, 0, scene.shape.shell_width_m)
    found = []
    for rows in torch.arange(len(shell.pixels)).split(_RAYS_AT_ONCE):
        rays, along = pixel_rays(camera, shell.pixels[rows])
        rendered = render_rays(
            scene.field,
            moments,
            rays,
            torch.zeros(len(rows), dtype=torch.int64),
            shell.nearest[rows] * along,
            shell.farthest[rows] * along,
            appearance,
            torch.ones(len(rows), 3),
            torch.full((len(rows),), 0.5),
            scene.shape.shell_width_m,
            scene.sampling,
        )
        found.append(half_opaque_points(rendered, rays.directions))
    return torch.cat(found).double().numpy() if found else np.empty((0, 3))


def half_opaque_points(rendered: RenderedRays, directions: Tensor) -> Tensor:
    """The crossing of each ray that has one, (N, 3), exact within its step.

    A sample stands in the middle of its step, over which the density is constant.
    """
    samples, rays = rendered.shell.samples, len(directions)
    thickness = (rendered.density * samples.step_m).double()
    total = sum_along_rays(thickness, samples.ray, rays)
    before_ray = torch.cumsum(total, 0) - total
    behind = torch.cumsum(thickness, 0) - before_ray[samples.ray]
    ahead = behind - thickness
    crossing = (ahead < HALF_OPAQUE) & (behind >= HALF_OPAQUE)
    share = (HALF_OPAQUE - ahead[crossing]) / thickness[crossing]
    along = ((share - 0.5) * samples.step_m[crossing])[:, None].to(directions.dtype)
    return samples.points[crossing] + along * directions[samples.ray[crossing]]
