"""The sum of losses that one step minimises, for the fast representation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import torch
from torch import Tensor

from mocoflow_core.losses.motion_consensus import global_consensus, local_consensus
from mocoflow_core.losses.photometric import photometric, silhouette
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.shell_scene import ShellRays, ShellScene
from mocoflow_core.training.batches import Batch
from mocoflow_core.training.ranks import ALONE, Ranks, own_of


class Objective(Protocol):
    """Losses of a batch by name, already weighted; their sum over names and ranks is minimised.

    Each rank gives its rays' parts of the means over all rays, samples or points of the step.
    """

    def __call__(self, batch: Batch, generator: torch.Generator) -> dict[str, Tensor]:
        """All terms; further random numbers come from the generator."""


def sum_of(terms: Mapping[str, Tensor]) -> Tensor:
    """What is minimised."""
    return torch.stack(list(terms.values())).sum()


class ShellObjective:
    """What preset ``fast`` minimises."""

    def __init__(
        self, scene: ShellScene, losses: LossConfig, motion_learned: bool, ranks: Ranks = ALONE
    ) -> None:
        self.scene = scene
        self.losses = losses
        self.motion_learned = motion_learned
        self.ranks = ranks

    def __call__(self, batch: Batch, generator: torch.Generator) -> dict[str, Tensor]:
        weights, appearance = self.losses, self.scene.appearance
        rendered = self.scene.render(
            batch.rays, batch.row, batch.near, batch.far, batch.background, batch.jitter
        )
        opacity, mask = rendered.opacity * batch.has_mask, batch.mask * batch.has_mask
        _, samples = self.ranks.before(len(rendered.offset_m))
        terms = {
            "photometric": photometric(rendered.rgb, batch.rgb, batch.rays_in_all),
            "silhouette": weights.silhouette_weight * silhouette(opacity, mask, batch.rays_in_all),
            "offset": weights.offset_weight * (rendered.offset_m**2).sum() / max(samples, 1),
        }
        if appearance.requires_grad:
            # Of no ray in particular: each rank brings an equal part.
            codes = (appearance**2).mean() / self.ranks.count
            terms["appearance"] = weights.appearance_weight * codes
        if self.motion_learned:
            terms |= self._motion_terms(rendered, generator)
        return terms

    def _motion_terms(self, rendered: ShellRays, generator: torch.Generator) -> dict[str, Tensor]:
        """Consensus and regularity of the motion at a few samples that have density."""
        weights, shell, scene = self.losses, rendered.shell, self.scene
        solid = (rendered.density.detach() > weights.density_threshold).nonzero()[:, 0]
        earlier, everywhere = self.ranks.before(len(solid))
        drawn = min(weights.consensus_points or everywhere, everywhere)
        pick = torch.randint(max(everywhere, 1), (drawn,), generator=generator)
        chosen = solid[own_of(pick.to(solid), earlier, len(solid))]
        count = max(drawn, 1)
        points, body, row = shell.samples.points[chosen], shell.canonical[chosen], shell.row[chosen]
        motion, moments = scene.field.motion, scene.moments
        frames = len(moments.codes)
        moved = motion.correct(body, row, moments)
        later = motion.correct(body, (row + 1).clamp_max(frames - 1), moments)
        terms = {
            "residual": weights.residual_weight * ((moved - body) ** 2).sum() / count,
            "smoothness": weights.smoothness_weight * ((moved - later) ** 2).sum() / count,
        }
        if weights.consensus_weight > 0:
            moves = (scene.to_canonical, scene.to_observed)
            other = torch.randint(frames, (1,), generator=generator).to(row).expand_as(row)
            in_all = self.ranks.total
            local = local_consensus(*moves, points, row, in_all=in_all)
            far = global_consensus(*moves, points, row, other, in_all=in_all)
            terms["consensus"] = weights.consensus_weight * (
                weights.local_share * local + weights.global_share * far
            )
        return terms
