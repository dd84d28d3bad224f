"""The sum of losses that one step minimises, for the paper's networks."""

from __future__ import annotations

import torch
from torch import Tensor

from mocoflow_core.losses.motion_consensus import global_consensus, local_consensus
from mocoflow_core.losses.motion_fit import correspondence, free_space
from mocoflow_core.losses.photometric import photometric, silhouette
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.box_scene import BoxRays, BoxScene
from mocoflow_core.training.batches import Batch
from mocoflow_core.training.fit_points import FitPoints
from mocoflow_core.training.ranks import ALONE, Ranks, own_of


class NetworkObjective:
    """``L_photo + 0.2 L_moco``, and ``+ 10 L_fit`` while the motion is fitted to the mesh.

    Source: MoCo-Flow eqs. 2-6.
    """

    def __init__(
        self,
        scene: BoxScene,
        losses: LossConfig,
        consensus: bool,
        fit_points: FitPoints | None = None,
        ranks: Ranks = ALONE,
    ) -> None:
        self.scene = scene
        self.losses = losses
        self.consensus = consensus
        self.fit_points = fit_points
        self.ranks = ranks

    def __call__(self, batch: Batch, generator: torch.Generator) -> dict[str, Tensor]:
        weights, rays = self.losses, batch.rays_in_all
        rendered = self.scene.render(
            batch.rays, batch.row, batch.near, batch.far, batch.background, batch.jitter
        )
        terms = {
            "photometric": photometric(rendered.rgb, batch.rgb, rays),
            "photometric_coarse": photometric(rendered.coarse_rgb, batch.rgb, rays),
        }
        if weights.silhouette_weight > 0:
            mask = batch.mask * batch.has_mask
            terms["silhouette"] = weights.silhouette_weight * (
                silhouette(rendered.opacity * batch.has_mask, mask, rays)
                + silhouette(rendered.coarse_opacity * batch.has_mask, mask, rays)
            )
        if self.consensus and weights.consensus_weight > 0:
            terms["consensus"] = weights.consensus_weight * self._consensus(rendered, generator)
        if self.fit_points is not None and weights.fit_weight > 0:
            # Of no ray: each rank brings an equal part.
            fit = self._fit(batch.first_row, generator) / self.ranks.count
            terms["fit"] = weights.fit_weight * fit
        return terms

    def _consensus(self, rendered: BoxRays, generator: torch.Generator) -> Tensor:
        """Over the samples with density, hidden ones too; one other moment for the whole step."""
        weights, scene = self.losses, self.scene
        moments = len(scene.boxes.times)
        other = torch.randint(moments, (1,), generator=generator).to(rendered.row)
        solid = (rendered.density.detach() > weights.density_threshold).nonzero()[:, 0]
        earlier, everywhere = self.ranks.before(len(solid))
        if weights.consensus_points is not None and everywhere > weights.consensus_points:
            pick = torch.randint(everywhere, (weights.consensus_points,), generator=generator)
            solid = solid[own_of(pick.to(solid), earlier, len(solid))]
        points, row = rendered.samples.points[solid], rendered.row[solid]
        mapped = (rendered.canonical[solid], torch.ones_like(row, dtype=torch.bool))
        moves = (scene.to_canonical, scene.to_observed, points, row)
        loss = points.new_zeros(())
        if weights.local_share > 0:
            local = local_consensus(*moves, mapped, self.ranks.total)
            loss = loss + weights.local_share * local
        if weights.global_share > 0:
            far = global_consensus(*moves, other.expand_as(row), mapped, self.ranks.total)
            loss = loss + weights.global_share * far
        return loss

    def _fit(self, row: int, generator: torch.Generator) -> Tensor:
        """``L_fit`` at one moment: both directions against the mesh, and nothing in free space."""
        assert self.fit_points is not None
        scene, field = self.scene, self.scene.field
        drawn = self.fit_points.draw(row, generator)
        at = torch.full((len(drawn.observed),), row)
        to_canonical, _ = scene.to_canonical(drawn.observed, at)
        to_observed, _ = scene.to_observed(drawn.canonical, at)
        emptied, _ = scene.to_canonical(drawn.free, torch.full((len(drawn.free),), row))
        density, _ = field.density(field.fine, emptied)
        return (
            correspondence(to_canonical, drawn.canonical)
            + correspondence(to_observed, drawn.observed)
            + free_space(density, self.losses.free_step_m)
        )
