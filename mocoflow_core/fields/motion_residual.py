"""What the body mesh gets wrong: a small SE(3) field in canonical space, zero at the start."""

from __future__ import annotations

from itertools import pairwise

import torch
from pydantic import Field
from torch import Tensor, nn

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.encoding import FrequencyEncoding
from mocoflow_core.geometry.se3 import transform_points


class ResidualConfig(ConfigurationPart):
    """Size of the residual motion networks."""

    bands: int = Field(4, ge=0, description="annealed frequency bands of the position")
    code_width: int = Field(16, ge=1, description="length of the per-frame code")
    hidden: int = Field(64, ge=1)
    layers: int = Field(2, ge=1, description="hidden layers")


class ResidualMotion(nn.Module):
    """Moves canonical points by ``exp(twist(x, code))`` about the middle of the body."""

    centre: Tensor

    def __init__(self, centre: Tensor, radius: float, configuration: ResidualConfig) -> None:
        """Args: centre (3,) and radius of the canonical body's box, metres."""
        super().__init__()
        self.register_buffer("centre", centre, persistent=False)
        self.radius = radius
        self.encoding = FrequencyEncoding(3, configuration.bands)
        widths = [self.encoding.width + configuration.code_width]
        widths += [configuration.hidden] * configuration.layers
        hidden: list[nn.Module] = []
        for fan_in, fan_out in pairwise(widths):
            hidden += [nn.Linear(fan_in, fan_out), nn.ReLU()]
        head = nn.Linear(widths[-1], 6)
        self.network = nn.Sequential(*hidden, head)
        # The start is the identity: the mesh's own motion.
        nn.init.zeros_(head.weight)
        nn.init.zeros_(head.bias)

    def forward(self, points: Tensor, code: Tensor) -> Tensor:
        """Canonical points (P, 3) with the codes of their moments (P, C) -> moved points."""
        local = (points - self.centre) / self.radius
        twist = self.network(torch.cat([self.encoding(local), code], -1))
        return self.centre + self.radius * transform_points(twist, local)
