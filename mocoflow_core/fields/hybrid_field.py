"""The fast representation: the body's motion with a residual, a grid on top of the mesh."""

from __future__ import annotations

from collections.abc import Iterator

from torch import Tensor, nn

from mocoflow_core.fields.canonical_grid import CanonicalGrid
from mocoflow_core.fields.motion_hybrid import HybridMotion, Moments
from mocoflow_core.fields.scene_field import RateGroups, SceneField


class HybridField(SceneField):
    """The fields of preset ``fast``."""

    def __init__(self, times: Tensor, motion: HybridMotion, canonical: CanonicalGrid) -> None:
        super().__init__(times, canonical.configuration.appearance_width)
        self.motion = motion
        self.canonical = canonical

    @property
    def bands(self) -> int:
        return self.motion.residual_to_canonical.encoding.bands

    def anneal(self, band_alpha: float) -> None:
        self.motion.anneal(band_alpha)

    def motion_parameters(self) -> Iterator[nn.Parameter]:
        return self.motion.parameters()

    def rate_groups(self) -> RateGroups:
        networks = [p for n, p in self.canonical.named_parameters() if not n.startswith("tables.")]
        motion = [*self.motion.parameters(), self.appearance]
        return RateGroups(list(self.canonical.tables), networks, motion)

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
