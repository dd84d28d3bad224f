"""The paper's representation at given moments: coarse and fine samples in each frame's box.

Exactly the paper's result, without the work that cannot change it: rays that miss the box, samples
without density (a ReLU gives them neither colour nor gradient), colours that nothing shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from mocoflow_core.fields.canonical_mlp import RadianceNetwork
from mocoflow_core.fields.network_field import NetworkField
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays, pixel_rays
from mocoflow_core.rendering.compositing import composite, sum_along_rays
from mocoflow_core.rendering.frame_box import FrameBoxes
from mocoflow_core.rendering.hierarchical import borders, draw_where_weight_is, spread_evenly
from mocoflow_core.rendering.pixels import VisiblePixels
from mocoflow_core.rendering.posed_scene import RenderedRays
from mocoflow_core.rendering.sampling import PackedSamples

# exp(-16) is 1e-7, the rounding of a sum of weights: what lies behind more than that is not seen.
_HIDDEN = 16.0
_NO_WEIGHT = 1e-7


@dataclass(frozen=True, eq=False)
class BoxRays(RenderedRays):
    """Rays through the box; ``samples`` and ``density`` are those of the fine network."""

    coarse_rgb: Tensor  # (R, 3)
    coarse_opacity: Tensor  # (R,)
    row: Tensor  # (S,) moment of each sample
    canonical: Tensor  # (S, 3); with gradients where the density is not zero


class BoxScene:
    """The paper's networks at G moments."""

    rays_at_once = 1024

    def __init__(
        self, field: NetworkField, boxes: FrameBoxes, coarse_samples: int, fine_samples: int
    ) -> None:
        """Args: boxes with a row for each moment; their times are those of the moments.

        They go to the device that the field lies on.
        """
        self.field = field
        self.boxes = boxes.to(field.device)
        self.coarse_samples = coarse_samples
        self.jitters = coarse_samples + fine_samples

    @property
    def time_codes(self) -> Tensor:
        """Encoded times (G, T) of the moments."""
        return self.field.time_codes(self.boxes.times)

    @property
    def appearance(self) -> Tensor:
        """Appearance codes (G, A) of the moments."""
        return self.field.appearance_at(self.boxes.times)

    def pixels(self, camera: Camera, row: int) -> VisiblePixels:
        """All pixels, as the paper draws them; those that miss the box have no depth range."""
        pixels = torch.arange(camera.width * camera.height, device=self.field.device)
        rays, along = pixel_rays(camera, pixels)
        near, far = self.boxes.intersect(rays, torch.full_like(pixels, row))
        hit = far > near
        return VisiblePixels(
            pixels.cpu(),
            (torch.where(hit, near, 0.0) / along).cpu(),
            (torch.where(hit, far, 0.0) / along).cpu(),
        )

    def to_canonical(self, points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        moved = self.field.to_canonical(points, self.time_codes[row])
        return moved, torch.ones_like(row, dtype=torch.bool)

    def to_observed(self, points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        moved = self.field.to_observed(points, self.time_codes[row])
        return moved, torch.ones_like(row, dtype=torch.bool)

    def render(
        self,
        rays: Rays,
        row: Tensor,
        near: Tensor,
        far: Tensor,
        background: Tensor,
        jitter: Tensor,
    ) -> BoxRays:
        hit = (far > near).nonzero()[:, 0]
        found = self._through_box(
            rays.select(hit), row[hit], near[hit], far[hit], background[hit], jitter[hit]
        )
        nothing = torch.zeros(len(rays), dtype=background.dtype, device=background.device)
        samples = found.samples
        return BoxRays(
            background.index_copy(0, hit, found.rgb),
            nothing.index_copy(0, hit, found.opacity),
            PackedSamples(samples.points, hit[samples.ray], samples.step_m),
            found.density,
            background.index_copy(0, hit, found.coarse_rgb),
            nothing.index_copy(0, hit, found.coarse_opacity),
            found.row,
            found.canonical,
        )

    def _through_box(
        self,
        rays: Rays,
        row: Tensor,
        near: Tensor,
        far: Tensor,
        background: Tensor,
        jitter: Tensor,
    ) -> BoxRays:
        """The same for R rays that all meet their box."""
        field, count = self.field, self.coarse_samples
        with torch.no_grad():
            thin = spread_evenly(near, far, jitter[:, :count])
            coarse = self._samples(rays, thin, near, far)
            mapped, _ = self.to_canonical(coarse.points, row[coarse.ray])
            fog, _ = field.density(field.coarse, mapped)
            weights, _ = composite(fog, coarse.step_m, coarse.ray, len(rays))
            dense = draw_where_weight_is(
                borders(thin, near, far), weights.reshape(thin.shape), jitter[:, count:]
            )
            added = self._samples(rays, dense, near, far)
            mapped_too, _ = self.to_canonical(added.points, row[added.ray])
            distance, order = torch.cat([thin, dense], 1).sort(1)
            samples = self._samples(rays, distance, near, far)
            canonical = _in_order(mapped, mapped_too, order)
            density, _ = field.density(field.fine, canonical)
            place = order.argsort(1)[:, :count] + distance.shape[1] * torch.arange(
                len(rays), device=order.device
            ).unsqueeze(1)
            of_coarse = place.reshape(-1)  # where each coarse sample stands among all
        canonical = self._with_gradients(samples, row, canonical, density, fog, of_coarse)
        seen = (row, background, rays.directions)
        coarse_rgb, coarse_opacity, _ = self._composite(
            field.coarse, coarse, canonical[of_coarse], fog, *seen
        )
        rgb, opacity, density = self._composite(field.fine, samples, canonical, density, *seen)
        return BoxRays(
            rgb,
            opacity,
            samples,
            density,
            coarse_rgb,
            coarse_opacity,
            row[samples.ray],
            canonical,
        )

    def _samples(self, rays: Rays, distance: Tensor, near: Tensor, far: Tensor) -> PackedSamples:
        """Sorted distances (R, N) as packed samples with the stretches that they stand for."""
        count = distance.shape[1]
        ray = torch.arange(len(rays), device=distance.device).repeat_interleave(count)
        points = rays.select(ray).at(distance.reshape(-1))
        return PackedSamples(points, ray, borders(distance, near, far).diff(dim=1).reshape(-1))

    def _with_gradients(
        self,
        samples: PackedSamples,
        row: Tensor,
        canonical: Tensor,
        density: Tensor,
        coarse_density: Tensor,
        of_coarse: Tensor,
    ) -> Tensor:
        """The same canonical points (S, 3), with gradients where either network has density."""
        if not torch.is_grad_enabled():
            return canonical
        wanted = density > 0
        wanted[of_coarse] |= coarse_density > 0
        chosen = wanted.nonzero()[:, 0]
        moved, _ = self.to_canonical(samples.points[chosen], row[samples.ray[chosen]])
        return canonical.index_copy(0, chosen, moved)

    def _composite(
        self,
        network: RadianceNetwork,
        samples: PackedSamples,
        canonical: Tensor,
        density: Tensor,
        row: Tensor,
        background: Tensor,
        directions: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """rgb (R, 3), opacity (R,) and density (S,) with gradients where they can be felt."""
        rays, ray = len(background), samples.ray
        # Not -1: there may be no ray at all.
        thickness = (density * samples.step_m).reshape(rays, len(density) // max(rays, 1))
        ahead = (thickness.cumsum(1) - thickness).reshape(-1)
        felt = ((density > 0) & (ahead < _HIDDEN)).nonzero()[:, 0]
        present, hidden = self.field.density(network, canonical[felt])
        density = density.index_copy(0, felt, present)
        weights, transmittance = composite(density, samples.step_m, ray, rays)
        shown = (weights.detach()[felt] > _NO_WEIGHT).nonzero()[:, 0]
        chosen = felt[shown]
        seen_by = ray[chosen]
        rgb = network.colour(hidden[shown], self.appearance[row[seen_by]], directions[seen_by])
        colour = sum_along_rays(weights[chosen, None] * rgb, seen_by, rays)
        return colour + transmittance[:, None] * background, 1.0 - transmittance, density


def _in_order(first: Tensor, second: Tensor, order: Tensor) -> Tensor:
    """Points of the coarse (R N, 3) and the added samples (R M, 3), merged as the order (R, N + M)
    of their distances says, (R (N + M), 3)."""
    rays = len(order)
    parts = [points.reshape(rays, len(points) // max(rays, 1), 3) for points in (first, second)]
    both = torch.cat(parts, 1)
    return both.gather(1, order[..., None].expand(-1, -1, 3)).reshape(-1, 3)
