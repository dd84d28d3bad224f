"""All that is learned about one scene: motion, canonical field and appearance codes."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from mocoflow_core.fields.canonical_grid import CanonicalGrid
from mocoflow_core.fields.motion_hybrid import HybridMotion, Moments, interpolate_rows


class SceneField(nn.Module):
    """The fields of one scene; the paper's networks will stand behind the same methods."""

    def __init__(self, motion: HybridMotion, canonical: CanonicalGrid) -> None:
        super().__init__()
        self.motion = motion
        self.canonical = canonical
        width = canonical.configuration.appearance_width
        self.appearance = nn.Parameter(torch.zeros(len(motion.times), width))

    def anneal(self, band_alpha: float) -> None:
        """Set the coarse-to-fine state of every encoding."""
        self.motion.anneal(band_alpha)

    def appearance_at(self, times: Tensor) -> Tensor:
        """Appearance codes (G, A) at any times (G,), linear between training frames."""
        return interpolate_rows(self.appearance, self.motion.times, times)

    def at_samples(
        self,
        body_canonical: Tensor,
        facing: Tensor,
        row: Tensor,
        moments: Moments,
        appearance: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Colour (P, 3), density (P,) and surface offset (P,) of samples mapped by the body."""
        canonical = self.motion.correct(body_canonical, row, moments)
        return self.canonical(canonical, appearance[row], facing)
