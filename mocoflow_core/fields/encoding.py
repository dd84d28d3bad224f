"""Frequency encoding with bands that fade in from coarse to fine."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from mocoflow_core.errors import InputError

# A rounding of the coordinate may move the phase of the highest band by 2^-5 of half a turn.
_DIGITS_LEFT = 5


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


def most_bands(dtype: torch.dtype) -> int:
    """How many bands coordinates of this type have digits for: 19 for float32, 3 for bfloat16."""
    return max(1 - _DIGITS_LEFT - round(math.log2(torch.finfo(dtype).eps)), 0)


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
        """(..., D) -> (..., D (1 + 2 bands)).

        Raises InputError for coordinates too short for the highest band: its phase would be noise.
        """
        if self.bands > most_bands(x.dtype):
            raise InputError(
                f"{self.bands} bands need coordinates that carry them",
                f"{x.dtype}, good for {most_bands(x.dtype)}",
                "Encode float32 coordinates; autocast leaves them as they are.",
            )
        angles = x[..., None] * self.frequencies
        waves = torch.cat([torch.sin(angles), torch.cos(angles)], -1)
        weighted = waves * torch.cat([self.weights, self.weights])
        return torch.cat([x, weighted.flatten(-2)], -1)
