"""What fixes the paper's networks: their configuration and the canonical body's place."""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.network_field import NetworkField, NetworksConfig


class NetworkShape(ConfigurationPart):
    """Everything besides weights and boxes that is needed to build a scene's networks again."""

    representation: Literal["networks"] = "networks"
    networks: NetworksConfig
    times: tuple[float, ...] = Field(description="training frames, normalised")
    centre_m: tuple[float, float, float] = Field(description="of the canonical body's box, world")
    radius_m: float = Field(gt=0, description="half the longest side of that box")
    moves: bool = Field(True, description="false: the body stands still")
    coarse_samples: int = Field(ge=1)
    fine_samples: int = Field(ge=1)

    def build(self) -> NetworkField:
        """Networks with fresh weights, drawn from torch's global generator."""
        field = NetworkField(
            torch.tensor(self.times, dtype=torch.float64),
            torch.tensor(self.centre_m),
            self.radius_m,
            self.networks,
        )
        field.moves = self.moves
        return field
