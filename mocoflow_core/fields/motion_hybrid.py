"""The fast motion field: what the body mesh says, corrected by a learned residual."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.motion_residual import ResidualConfig, ResidualMotion
from mocoflow_core.fields.scene_field import interpolate_rows


@dataclass(frozen=True, eq=False)
class Moments:
    """What the motion needs to know about the moments that points belong to, one row each."""

    body: BodyMotion  # its frames are the rows
    codes: Tensor  # (G, C)

    def to(self, device: torch.device) -> Moments:
        return Moments(self.body.to(device), self.codes.to(device))


class HybridMotion(nn.Module):
    """``to_canonical`` and ``to_observed`` (the paper's M^bw and M^fw) on top of the body.

    The residual of either direction acts in canonical space, where its input is bounded.
    """

    times: Tensor

    def __init__(
        self, times: Tensor, centre: Tensor, radius: float, configuration: ResidualConfig
    ) -> None:
        """Args: times (F,) of the training frames, normalised, ascending."""
        super().__init__()
        self.register_buffer("times", times.double(), persistent=False)
        self.corrects = True  # false: the body's motion is right already, no network is asked
        self.codes = nn.Parameter(0.1 * torch.randn(len(times), configuration.code_width))
        self.residual_to_canonical = ResidualMotion(centre, radius, configuration)
        self.residual_to_observed = ResidualMotion(centre, radius, configuration)

    def anneal(self, band_alpha: float) -> None:
        for residual in (self.residual_to_canonical, self.residual_to_observed):
            residual.encoding.anneal(band_alpha)

    def codes_at(self, times: Tensor) -> Tensor:
        """Codes (G, C) at any times (G,), linear between training frames."""
        return interpolate_rows(self.codes, self.times, times)

    def correct(self, body_canonical: Tensor, row: Tensor, moments: Moments) -> Tensor:
        """Where canonical points of the body's motion really lie, (P, 3)."""
        if not self.corrects:
            return body_canonical
        return self.residual_to_canonical(body_canonical, moments.codes[row])

    def to_canonical(self, points: Tensor, row: Tensor, moments: Moments) -> Tensor:
        """Observed points (P, 3) of moments (P,) to canonical space."""
        return self.correct(moments.body.to_canonical(points, row)[0], row, moments)

    def to_observed(self, points: Tensor, row: Tensor, moments: Moments) -> tuple[Tensor, Tensor]:
        """Canonical points (P, 3) to the space of their moments; and where the body is near."""
        if self.corrects:
            points = self.residual_to_observed(points, moments.codes[row])
        return moments.body.to_observed(points, row)
