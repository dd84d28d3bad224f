"""The paper's representation: two radiance networks, two motion networks, appearance codes."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Literal

import torch
from pydantic import Field
from torch import Tensor, nn

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.canonical_mlp import RadianceNetwork
from mocoflow_core.fields.encoding import FrequencyEncoding
from mocoflow_core.fields.motion_mlp import MotionNetwork
from mocoflow_core.fields.scene_field import RateGroups, SceneField
from mocoflow_core.fields.skip_network import SkipConfig


class NetworksConfig(ConfigurationPart):
    """Sizes of the paper's networks."""

    radiance: SkipConfig = SkipConfig()
    motion: SkipConfig = SkipConfig()
    position_bands: int = Field(8, ge=0, description="annealed bands of positions (paper: 8)")
    time_bands: int = Field(16, ge=0, description="constant bands of the time (paper: 16)")
    appearance_width: int = Field(8, ge=1, description="length of the per-image code (paper: 8)")
    colour_width: int = Field(128, ge=1, description="layer between features and rgb")
    colour_sees: Literal["point", "point_and_direction"] = Field(
        "point", description="the viewing direction is constant in training (paper: left out)"
    )
    direction_bands: int = Field(4, ge=0, description="of the ablation with ray direction")
    density_unit_per_m: float = Field(
        10.0, gt=0, description="density of a network's output of one"
    )


class NetworkField(SceneField):
    """The fields of preset ``paper``. Points are world metres; networks see units of the body."""

    centre: Tensor

    def __init__(
        self, times: Tensor, centre: Tensor, radius: float, configuration: NetworksConfig
    ) -> None:
        """Args: times (F,) of the training frames; centre (3,), radius of the canonical box."""
        super().__init__(times, configuration.appearance_width)
        self.register_buffer("centre", centre, persistent=False)
        self.radius = radius
        self.moves = True  # false: the body stands still, and no network is asked
        # One encoding for all networks: their bands fade in together.
        self.encoding = FrequencyEncoding(3, configuration.position_bands)
        self.time_encoding = FrequencyEncoding(1, configuration.time_bands)
        self.time_encoding.anneal(float(configuration.time_bands))
        self.coarse = self._radiance(configuration)
        self.fine = self._radiance(configuration)
        motion = (self.encoding.width, self.time_encoding.width, configuration.motion)
        self.canonical_motion = MotionNetwork(*motion)
        self.observed_motion = MotionNetwork(*motion)

    def _radiance(self, configuration: NetworksConfig) -> RadianceNetwork:
        direction = None
        if configuration.colour_sees == "point_and_direction":
            direction = FrequencyEncoding(3, configuration.direction_bands)
            direction.anneal(float(configuration.direction_bands))
        return RadianceNetwork(
            self.encoding.width,
            direction,
            configuration.appearance_width,
            configuration.colour_width,
            configuration.density_unit_per_m,
            configuration.radiance,
        )

    @property
    def bands(self) -> int:
        return self.encoding.bands

    def anneal(self, band_alpha: float) -> None:
        self.encoding.anneal(band_alpha)

    def motion_parameters(self) -> Iterator[nn.Parameter]:
        return chain(self.canonical_motion.parameters(), self.observed_motion.parameters())

    def rate_groups(self) -> RateGroups:
        networks = [*self.coarse.parameters(), *self.fine.parameters()]
        return RateGroups([], networks, [*self.motion_parameters(), self.appearance])

    def time_codes(self, times: Tensor) -> Tensor:
        """Encoded normalised times (G,) -> (G, T)."""
        return self.time_encoding(times[:, None].to(self.centre.dtype))

    def to_local(self, points: Tensor) -> Tensor:
        """World metres (P, 3) in units of the canonical body."""
        return (points - self.centre) / self.radius

    def density(self, network: RadianceNetwork, points: Tensor) -> tuple[Tensor, Tensor]:
        """Density (P,) in 1/m at canonical points (P, 3); and hidden values (P, W) for colours."""
        return network.density(self.encoding(self.to_local(points)))

    def to_canonical(self, points: Tensor, time_code: Tensor) -> Tensor:
        """Observed points (P, 3) with encoded times (P, T) to canonical space, world metres."""
        return self._moved(self.canonical_motion, points, time_code)

    def to_observed(self, points: Tensor, time_code: Tensor) -> Tensor:
        """Canonical points (P, 3) to the space of their moments, world metres."""
        return self._moved(self.observed_motion, points, time_code)

    def _moved(self, motion: MotionNetwork, points: Tensor, time_code: Tensor) -> Tensor:
        if not self.moves:
            return points
        local = self.to_local(points)
        return self.centre + self.radius * motion(local, self.encoding(local), time_code)


def density_parameters(field: NetworkField) -> list[nn.Parameter]:
    """The density branches of both radiance networks."""
    return [*field.coarse.density_parameters(), *field.fine.density_parameters()]


def box_of(points: Tensor, margin_m: float) -> tuple[tuple[float, float, float], float]:
    """Centre and half the longest side of the box around points (P, 3), enlarged by a margin."""
    lower, upper = points.amin(0) - margin_m, points.amax(0) + margin_m
    x, y, z = (0.5 * (lower + upper)).tolist()
    return (x, y, z), float(0.5 * torch.amax(upper - lower))
