"""The sum of losses that one step minimises."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from mocoflow_core.fields.motion_hybrid import Moments
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.losses.motion_consensus import Move, global_consensus, local_consensus
from mocoflow_core.losses.photometric import photometric, silhouette
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.renderer import RenderedRays, render_rays
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.training.batches import Batch
from mocoflow_core.training.ranks import ALONE, Ranks


class Objective(nn.Module):
    """Losses of a batch by name, already weighted; their sum over names and ranks is minimised.

    Each rank gives its rays' parts of the means over all rays, samples or points of the step.
    """

    def __init__(
        self,
        field: SceneField,
        moments: Moments,
        losses: LossConfig,
        sampling: SamplingConfig,
        shell_width_m: float,
        motion_learned: bool,
        ranks: Ranks = ALONE,
    ) -> None:
        super().__init__()
        self.field = field
        self.moments = moments
        self.losses = losses
        self.sampling = sampling
        self.shell_width_m = shell_width_m
        self.motion_learned = motion_learned
        self.ranks = ranks

    def forward(self, batch: Batch, generator: torch.Generator) -> dict[str, Tensor]:
        weights = self.losses
        rendered = render_rays(
            self.field,
            self.moments,
            batch.rays,
            batch.row,
            batch.near,
            batch.far,
            self.field.appearance,
            batch.background,
            batch.jitter,
            self.shell_width_m,
            self.sampling,
        )
        _, samples = self.ranks.before(len(rendered.offset_m))
        terms = {
            "photometric": photometric(rendered.rgb, batch.rgb, batch.rays_in_all),
            "silhouette": weights.silhouette_weight
            * silhouette(
                rendered.opacity * batch.has_mask, batch.mask * batch.has_mask, batch.rays_in_all
            ),
            "offset": weights.offset_weight * (rendered.offset_m**2).sum() / max(samples, 1),
        }
        if self.field.appearance.requires_grad:
            # No ray's: each rank brings an equal part.
            codes = (self.field.appearance**2).mean() / self.ranks.count
            terms["appearance"] = weights.appearance_weight * codes
        if self.motion_learned:
            terms |= self._motion_terms(rendered, generator)
        return terms

    def _motion_terms(
        self, rendered: RenderedRays, generator: torch.Generator
    ) -> dict[str, Tensor]:
        """Consensus and regularity of the motion at a few samples that have density."""
        weights, shell = self.losses, rendered.shell
        solid = (rendered.density.detach() > weights.density_threshold).nonzero()[:, 0]
        chosen, count = self._draw(solid, generator)
        points, body, row = shell.samples.points[chosen], shell.canonical[chosen], shell.row[chosen]
        motion, codes = self.field.motion, self.moments.codes
        moved = motion.correct(body, row, self.moments)
        neighbour = (row + 1).clamp_max(len(codes) - 1)
        later = motion.correct(body, neighbour, self.moments)
        terms = {
            "residual": weights.residual_weight * ((moved - body) ** 2).sum() / count,
            "smoothness": weights.smoothness_weight * ((moved - later) ** 2).sum() / count,
        }
        if weights.consensus_weight > 0:
            to_canonical, to_observed = self._moves()
            other = torch.randint(len(codes), (1,), generator=generator).expand_as(row)
            move, total = (to_canonical, to_observed), self.ranks.total
            local = local_consensus(*move, points, row, total)
            far = global_consensus(*move, points, row, other, total)
            terms["consensus"] = weights.consensus_weight * (
                weights.local_share * local + weights.global_share * far
            )
        return terms

    def _draw(self, solid: Tensor, generator: torch.Generator) -> tuple[Tensor, int]:
        """A few of all ranks' solid samples: those of this rank (P,), and how many they are in all.

        Samples are sorted by ray, so one draw over the samples of all ranks is the draw of one
        process that has all rays.
        """
        earlier, everywhere = self.ranks.before(len(solid))
        points = min(self.losses.consensus_points, everywhere)
        drawn = torch.randint(max(everywhere, 1), (points,), generator=generator) - earlier
        return solid[drawn[(drawn >= 0) & (drawn < len(solid))]], max(points, 1)

    def _moves(self) -> tuple[Move, Move]:
        motion, moments = self.field.motion, self.moments

        def to_canonical(points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
            by_body, known = moments.body.to_canonical(points, row)
            return motion.correct(by_body, row, moments), known

        def to_observed(points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
            return motion.to_observed(points, row, moments)

        return to_canonical, to_observed
