"""A motion field as the paper has it: one network from a point and a time to an SE(3)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from mocoflow_core.fields.skip_network import SkipConfig, SkipNetwork
from mocoflow_core.geometry.se3 import transform_points


class MotionNetwork(nn.Module):
    """Moves points by ``exp(twist(x, t))``, in units of the body; the identity at the start.

    Source: MoCo-Flow sec. 3.2.
    """

    def __init__(self, position_width: int, time_width: int, configuration: SkipConfig) -> None:
        super().__init__()
        self.trunk = SkipNetwork(position_width + time_width, configuration)
        self.head = nn.Linear(configuration.width, 6)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    def forward(self, local: Tensor, encoded: Tensor, time_code: Tensor) -> Tensor:
        """Move points.

        Args:
            local: (P, 3) in units of the body.
            encoded: (P, E) the same, encoded.
            time_code: (P, T) encoded times of their moments.
        """
        hidden = self.trunk(torch.cat([encoded, time_code], -1))
        return transform_points(self.head(hidden), local)
