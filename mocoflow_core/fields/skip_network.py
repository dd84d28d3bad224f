"""The paper's network: layers of one width, whose input enters once more on the way."""

from __future__ import annotations

import torch
from pydantic import Field
from torch import Tensor, nn

from mocoflow_core.configuration import ConfigurationPart


class SkipConfig(ConfigurationPart):
    """Size of one network (paper: 8 x 256, skip at 4)."""

    layers: int = Field(8, ge=1)
    width: int = Field(256, ge=1)
    skip: int = Field(4, ge=0, description="layer behind which the input is joined again")


class SkipNetwork(nn.Module):
    """(P, inputs) -> (P, width), ReLU behind every layer.

    Source: MoCo-Flow sec. 4 (network); NeRF (Mildenhall et al. 2020), fig. 7.
    """

    def __init__(self, inputs: int, configuration: SkipConfig) -> None:
        super().__init__()
        width, self.skip = configuration.width, configuration.skip
        layers = []
        for number in range(configuration.layers):
            joined = inputs if number == self.skip + 1 else 0
            layers.append(nn.Linear(width + joined if number else inputs, width))
        self.layers = nn.ModuleList(layers)
        self.width = width

    def forward(self, inputs: Tensor) -> Tensor:
        hidden = inputs
        for number, layer in enumerate(self.layers):
            if number == self.skip + 1:
                hidden = torch.cat([inputs, hidden], -1)
            hidden = torch.relu(layer(hidden))
        return hidden
