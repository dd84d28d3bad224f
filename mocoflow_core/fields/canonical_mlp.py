"""The canonical radiance field as the paper has it: one network from a point to density and rgb."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from mocoflow_core.fields.encoding import FrequencyEncoding
from mocoflow_core.fields.skip_network import SkipConfig, SkipNetwork


class RadianceNetwork(nn.Module):
    """Canonical points -> density (1/m), then colour from what the density's layers have found.

    Without a viewing direction in the paper's setting: it is constant in training.
    """

    def __init__(
        self,
        position_width: int,
        direction: FrequencyEncoding | None,
        appearance_width: int,
        colour_width: int,
        density_unit_per_m: float,
        configuration: SkipConfig,
    ) -> None:
        super().__init__()
        self.direction = direction
        self.density_unit_per_m = density_unit_per_m
        self.trunk = SkipNetwork(position_width, configuration)
        self.density_head = nn.Linear(configuration.width, 1)
        seen = configuration.width + appearance_width + (direction.width if direction else 0)
        self.feature = nn.Linear(configuration.width, configuration.width)
        self.colour_head = nn.Sequential(
            nn.Linear(seen, colour_width), nn.ReLU(), nn.Linear(colour_width, 3)
        )
        # Thin fog everywhere: a ReLU that starts below zero would never learn.
        nn.init.constant_(self.density_head.bias, 0.1)

    def density(self, encoded: Tensor) -> tuple[Tensor, Tensor]:
        """Density (P,) in 1/m at encoded points (P, E); and hidden values (P, W)."""
        hidden = self.trunk(encoded)
        return self.density_unit_per_m * torch.relu(self.density_head(hidden)[:, 0]), hidden

    def colour(self, hidden: Tensor, appearance: Tensor, directions: Tensor) -> Tensor:
        """rgb (P, 3) in [0, 1] as stored (sRGB).

        Args:
            hidden: (P, W) of ``density``.
            appearance: (P, A) codes of the points' images.
            directions: (P, 3) unit viewing directions, used by the ablation with ray direction.
        """
        parts = [self.feature(hidden), appearance]
        if self.direction is not None:
            parts.append(self.direction(directions))
        return torch.sigmoid(self.colour_head(torch.cat(parts, -1)))

    def density_parameters(self) -> list[nn.Parameter]:
        """The density branch: what fit_motion freezes."""
        return [*self.trunk.parameters(), *self.density_head.parameters()]
