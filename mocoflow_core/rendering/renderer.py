"""Rays through the scene's fields: sample the shell around the body, evaluate, composite."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from mocoflow_core.fields.motion_hybrid import Moments
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.geometry.rays import Rays
from mocoflow_core.rendering.compositing import composite, running_count, sum_along_rays
from mocoflow_core.rendering.sampling import PackedSamples, SamplingConfig, march


@dataclass(frozen=True, eq=False)
class ShellSamples:
    """Samples near the body, with what the body's motion says about each."""

    samples: PackedSamples
    canonical: Tensor  # (S, 3) by the body's motion alone
    facing: Tensor  # (S, 3) unit normals, world space
    row: Tensor  # (S,) moment of each sample


@dataclass(frozen=True, eq=False)
class RenderedRays:
    """What R rays see, and the samples behind it."""

    rgb: Tensor  # (R, 3) composited over the background
    opacity: Tensor  # (R,)
    shell: ShellSamples
    density: Tensor  # (S,) per metre
    offset_m: Tensor  # (S,)
    weights: Tensor  # (S,)


def sample_shell(
    field: SceneField,
    moments: Moments,
    rays: Rays,
    row: Tensor,
    near: Tensor,
    far: Tensor,
    jitter: Tensor,
    shell_width_m: float,
    configuration: SamplingConfig,
) -> ShellSamples:
    """Samples of rays (R,) of moments row (R,) that lie in the shell around the body.

    Between near and far (R,), lattice nodes and the distance from the moment's mesh leave out
    empty space. The inside of the body is opaque: what lies deeper under the skin than
    ``inner_depth_m``, or behind such a point, cannot be seen.
    """
    body = moments.body
    samples = march(
        rays,
        near,
        far,
        configuration.step_m,
        jitter,
        lambda points, ray: body.near_body(points, row[ray], shell_width_m),
    )
    corners = body.observed_grids.corners(samples.points, row[samples.ray])
    distance = body.distance(corners)
    hidden = running_count(distance < -configuration.inner_depth_m, samples.ray, len(rays)) > 0
    keep = ((distance < shell_width_m) & ~hidden).nonzero()[:, 0]
    samples, corners = samples.select(keep), (corners[0][keep], corners[1][keep])
    sample_row = row[samples.ray]
    canonical, _ = body.to_canonical(samples.points, sample_row, corners)
    return ShellSamples(samples, canonical, body.facing(corners), sample_row)


def render_rays(
    field: SceneField,
    moments: Moments,
    rays: Rays,
    row: Tensor,
    near: Tensor,
    far: Tensor,
    appearance: Tensor,
    background: Tensor,
    jitter: Tensor,
    shell_width_m: float,
    configuration: SamplingConfig,
) -> RenderedRays:
    """Render R rays.

    Args:
        rays: R rays in world space.
        row: (R,) moment of each ray.
        near, far: (R,) metres between which the shell lies.
        appearance: (G, A) codes of the moments.
        background: (R, 3) colour behind the person, seen through what opacity leaves.
        jitter: (R,) in [0, 1); 0.5 everywhere at evaluation.
    """
    with torch.no_grad():
        shell = sample_shell(
            field, moments, rays, row, near, far, jitter, shell_width_m, configuration
        )
    rgb, density, offset = field.at_samples(
        shell.canonical, shell.facing, shell.row, moments, appearance
    )
    ray = shell.samples.ray
    weights, transmittance = composite(density, shell.samples.step_m, ray, len(rays))
    seen = sum_along_rays(weights[:, None] * rgb, ray, len(rays))
    return RenderedRays(
        seen + transmittance[:, None] * background,
        1.0 - transmittance,
        shell,
        density,
        offset,
        weights,
    )
