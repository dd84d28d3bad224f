"""Frequency encoding with bands that fade in from coarse to fine."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn


def band_weights(band_alpha: float, bands: int) -> Tensor:
    """Weight of each frequency band, ``(1 - cos(pi clamp(band_alpha - k, 0, 1))) / 2``.

    Args:
        band_alpha: 0 switches all bands off, ``bands`` switches all of them on.
        bands: number of bands.

    Returns:
        (bands,) in [0, 1], falling with the band. Source: MoCo-Flow sec. 3.3; Nerfies eq. 8.
    """
    position = torch.clamp(band_alpha - torch.arange(bands, dtype=torch.float64), 0.0, 1.0)
    return 0.5 * (1.0 - torch.cos(math.pi * position))


class FrequencyEncoding(nn.Module):
    """``gamma(x) = (x, ..., w_k sin(2^k pi x), w_k cos(2^k pi x))`` with annealed weights.

    Expects coordinates in about [-1, 1]. ``band_alpha`` is set by the schedule.
    """

    weights: Tensor
    frequencies: Tensor

    def __init__(self, dimensions: int, bands: int) -> None:
        super().__init__()
        self.bands = bands
        self.width = dimensions * (1 + 2 * bands)
        self.register_buffer("weights", torch.zeros(bands))
        frequencies = math.pi * 2.0 ** torch.arange(bands, dtype=torch.float32)
        self.register_buffer("frequencies", frequencies, persistent=False)

    def anneal(self, band_alpha: float) -> None:
        """Set how many bands are on; kept in the state, so that a checkpoint carries it."""
        self.weights.copy_(band_weights(band_alpha, self.bands))

    def forward(self, x: Tensor) -> Tensor:
        """(..., D) -> (..., D (1 + 2 bands))."""
        angles = x[..., None] * self.frequencies
        waves = torch.cat([torch.sin(angles), torch.cos(angles)], -1)
        weighted = waves * torch.cat([self.weights, self.weights])
        return torch.cat([x, weighted.flatten(-2)], -1)
