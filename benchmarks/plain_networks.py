"""The paper's networks evaluated without leaving anything out: what the fast way is held against.

Every ray of the image, every sample, every colour, and the consensus at every sample, with the
selection as a mask afterwards.
"""

from __future__ import annotations

import torch
from torch import Tensor

from mocoflow_core.fields.canonical_mlp import RadianceNetwork
from mocoflow_core.geometry.rays import Rays
from mocoflow_core.losses.photometric import photometric
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.box_scene import BoxRays, BoxScene
from mocoflow_core.rendering.compositing import composite, sum_along_rays
from mocoflow_core.rendering.hierarchical import borders, draw_where_weight_is, spread_evenly
from mocoflow_core.rendering.sampling import PackedSamples
from mocoflow_core.training.batches import Batch


class PlainBoxScene(BoxScene):
    """The same pictures at the full price. A ray that misses has samples of no length."""

    def render(
        self,
        rays: Rays,
        row: Tensor,
        near: Tensor,
        far: Tensor,
        background: Tensor,
        jitter: Tensor,
    ) -> BoxRays:
        field, count = self.field, self.coarse_samples
        thin = spread_evenly(near, far, jitter[:, :count])
        coarse = self._samples(rays, thin, near, far)
        coarse_at, _ = self.to_canonical(coarse.points, row[coarse.ray])
        seen = (row, background, rays.directions)
        coarse_rgb, coarse_opacity, _, weights = self._all(field.coarse, coarse, coarse_at, *seen)
        with torch.no_grad():
            edges = borders(thin, near, far)
            dense = draw_where_weight_is(edges, weights.reshape(thin.shape), jitter[:, count:])
            distance, _ = torch.cat([thin, dense], 1).sort(1)
        samples = self._samples(rays, distance, near, far)
        canonical, _ = self.to_canonical(samples.points, row[samples.ray])
        rgb, opacity, density, _ = self._all(field.fine, samples, canonical, *seen)
        sample_row = row[samples.ray]
        return BoxRays(
            rgb, opacity, samples, density, coarse_rgb, coarse_opacity, sample_row, canonical
        )

    def _all(
        self,
        network: RadianceNetwork,
        samples: PackedSamples,
        canonical: Tensor,
        row: Tensor,
        background: Tensor,
        directions: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        ray, rays = samples.ray, len(background)
        density, hidden = self.field.density(network, canonical)
        rgb = network.colour(hidden, self.appearance[row[ray]], directions[ray])
        weights, transmittance = composite(density, samples.step_m, ray, rays)
        seen = sum_along_rays(weights[:, None] * rgb, ray, rays)
        return seen + transmittance[:, None] * background, 1.0 - transmittance, density, weights


def plain_losses(
    scene: PlainBoxScene, losses: LossConfig, batch: Batch, generator: torch.Generator
) -> dict[str, Tensor]:
    """The terms of ``NetworkObjective`` in the joint stage, everything evaluated."""
    rendered = scene.render(
        batch.rays, batch.row, batch.near, batch.far, batch.background, batch.jitter
    )
    other = torch.randint(len(scene.boxes.times), (1,), generator=generator)
    points, row = rendered.samples.points, rendered.row
    there = other.expand_as(row)
    canonical = rendered.canonical
    local, _ = scene.to_observed(canonical, row)
    elsewhere, _ = scene.to_observed(canonical, there)
    again, _ = scene.to_canonical(elsewhere, there)
    far, _ = scene.to_observed(again, row)
    # A sample of a ray that misses the box stands for no length: it is no sample of the paper's.
    chosen = (rendered.density.detach() > losses.density_threshold) & (rendered.samples.step_m > 0)
    apart = (local - points).abs().sum(-1) + (far - points).abs().sum(-1)
    consensus = (apart * chosen).sum() / chosen.sum().clamp_min(1)
    return {
        "photometric": photometric(rendered.rgb, batch.rgb),
        "photometric_coarse": photometric(rendered.coarse_rgb, batch.rgb),
        "consensus": losses.consensus_weight * consensus,
    }
