"""What every representation of a scene shares: appearance codes, annealing, groups of rates."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor, nn


class RateGroups(NamedTuple):
    """Parameters by the rate at which they learn."""

    features: list[nn.Parameter]
    networks: list[nn.Parameter]
    motion: list[nn.Parameter]


class SceneField(nn.Module, ABC):
    """All that is learned about one scene: motion, canonical field and appearance codes."""

    times: Tensor

    def __init__(self, times: Tensor, appearance_width: int) -> None:
        """Args: times (F,) of the training frames, normalised, ascending."""
        super().__init__()
        self.register_buffer("times", times.double(), persistent=False)
        self.appearance = nn.Parameter(torch.zeros(len(times), appearance_width))

    @property
    def device(self) -> torch.device:
        return self.times.device

    def appearance_at(self, times: Tensor) -> Tensor:
        """Appearance codes (G, A) at any times (G,), linear between training frames."""
        return interpolate_rows(self.appearance, self.times, times)

    @property
    @abstractmethod
    def bands(self) -> int:
        """How many annealed frequency bands there are."""

    @abstractmethod
    def anneal(self, band_alpha: float) -> None:
        """Set the coarse-to-fine state of every encoding of a position."""

    @abstractmethod
    def motion_parameters(self) -> Iterator[nn.Parameter]:
        """Parameters of the motion alone, without appearance codes."""

    @abstractmethod
    def rate_groups(self) -> RateGroups:
        """All parameters, each in one group."""


def interpolate_rows(values: Tensor, at: Tensor, times: Tensor) -> Tensor:
    """Rows (F, C) given at ascending times (F,), linearly interpolated at times (G,), (G, C)."""
    if len(at) == 1:
        return values.expand(len(times), -1)
    times = times.double().clamp(at[0], at[-1])
    after = torch.searchsorted(at, times).clamp(1, len(at) - 1)
    share = ((times - at[after - 1]) / (at[after] - at[after - 1])).to(values.dtype)[:, None]
    return (1.0 - share) * values[after - 1] + share * values[after]
