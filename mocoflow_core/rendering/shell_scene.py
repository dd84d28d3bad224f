"""The fast representation at given moments: sample the shell around the body and composite."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.motion_hybrid import Moments
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays
from mocoflow_core.rendering.compositing import composite, running_count, sum_along_rays
from mocoflow_core.rendering.pixels import VisiblePixels, shell_pixels
from mocoflow_core.rendering.posed_scene import RenderedRays
from mocoflow_core.rendering.sampling import PackedSamples, SamplingConfig, march


@dataclass(frozen=True, eq=False)
class ShellSamples:
    """Samples near the body, with what the body's motion says about each."""

    samples: PackedSamples
    canonical: Tensor  # (S, 3) by the body's motion alone
    facing: Tensor  # (S, 3) unit normals, world space
    row: Tensor  # (S,) moment of each sample


@dataclass(frozen=True, eq=False)
class ShellRays(RenderedRays):
    """Rays through the shell."""

    shell: ShellSamples
    offset_m: Tensor  # (S,) of the surface from the mesh's


class ShellScene:
    """A hybrid field at G moments."""

    jitters = 1
    rays_at_once = 16_384

    def __init__(
        self,
        field: HybridField,
        body: BodyMotion,
        shell_width_m: float,
        sampling: SamplingConfig,
        times: Tensor | None = None,
    ) -> None:
        """Args: body with a row for each of ``times`` (G,); None: the training frames.

        What is not there yet goes to the device that the field lies on.
        """
        self.field = field
        self.body = body if body.times.device == field.device else body.to(field.device)
        self.shell_width_m = shell_width_m
        self.sampling = sampling
        self.times = None if times is None else times.to(field.device)

    @property
    def moments(self) -> Moments:
        """The motion of the moments with the field's present weights."""
        motion = self.field.motion
        codes = motion.codes if self.times is None else motion.codes_at(self.times)
        return Moments(self.body, codes)

    @property
    def appearance(self) -> Tensor:
        """Appearance codes (G, A)."""
        field = self.field
        return field.appearance if self.times is None else field.appearance_at(self.times)

    def pixels(self, camera: Camera, row: int) -> VisiblePixels:
        return shell_pixels(camera, self.body, row, self.shell_width_m)

    def to_canonical(self, points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        by_body, known = self.body.to_canonical(points, row)
        return self.field.motion.correct(by_body, row, self.moments), known

    def to_observed(self, points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        return self.field.motion.to_observed(points, row, self.moments)

    def render(
        self,
        rays: Rays,
        row: Tensor,
        near: Tensor,
        far: Tensor,
        background: Tensor,
        jitter: Tensor,
    ) -> ShellRays:
        with torch.no_grad():
            shell = sample_shell(
                self.body, rays, row, near, far, jitter[:, 0], self.shell_width_m, self.sampling
            )
        rgb, density, offset = self.field.at_samples(
            shell.canonical, shell.facing, shell.row, self.moments, self.appearance
        )
        ray = shell.samples.ray
        weights, transmittance = composite(density, shell.samples.step_m, ray, len(rays))
        seen = sum_along_rays(weights[:, None] * rgb, ray, len(rays))
        return ShellRays(
            seen + transmittance[:, None] * background,
            1.0 - transmittance,
            shell.samples,
            density,
            shell,
            offset,
        )


def sample_shell(
    body: BodyMotion,
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
