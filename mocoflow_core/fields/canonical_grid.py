"""The canonical radiance field as sparse feature grids with two tiny networks.

Density starts from the canonical mesh's signed distance; the features learn how far the surface
lies from it and what colour it has. Coarse levels carry what fine levels have not seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from pydantic import Field
from torch import Tensor, nn

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.lighting import FixedLight
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior
from mocoflow_core.geometry.grid import SparseGrids, weighted_rows


class CanonicalConfig(ConfigurationPart):
    """Sizes of the canonical field."""

    # 10 and 7 mm cost more and show no more at unseen views: benchmarks/work_precision.md.
    finest_m: float = Field(0.014, gt=0, description="cell of the finest level, metres")
    level_ratio: float = Field(2.8, gt=1, description="cell size from one level to the next")
    levels: int = Field(3, ge=1)
    channels: int = Field(8, ge=1, description="features per level")
    hidden: int = Field(32, ge=1, description="width of the two networks")
    appearance_width: int = Field(8, ge=1, description="length of the per-image code (paper: 8)")
    sharpness_m: float = Field(0.006, gt=0, description="width of the density's edge at the start")
    largest_offset_m: float = Field(0.06, gt=0, description="how far the surface may move out")
    deepest_offset_m: float = Field(
        0.03, gt=0, description="and in: less than sampling.inner_depth_m, lest the body leaks"
    )
    margin_m: float = Field(0.02, ge=0, description="features beyond the shell, for moved samples")


class CanonicalGrid(nn.Module):
    """Features -> (rgb, density); density in 1/m, rgb in [0, 1] as stored (sRGB)."""

    def __init__(
        self,
        prior: SignedDistancePrior,
        grids: list[SparseGrids],
        configuration: CanonicalConfig,
        light: FixedLight,
    ) -> None:
        super().__init__()
        self.prior = prior
        self.grids = grids
        self.light = light
        self.configuration = configuration
        width = configuration.channels
        self.tables = nn.ParameterList(
            nn.Parameter(1e-2 * torch.randn(int(grid.node_map.max()) + 1, width)) for grid in grids
        )
        hidden = configuration.hidden
        entry, head = nn.Linear(width * len(grids), hidden), nn.Linear(hidden, 1 + hidden // 2)
        self.geometry = nn.Sequential(entry, nn.ReLU(), head)
        self.colour = nn.Sequential(
            nn.Linear(hidden // 2 + configuration.appearance_width, hidden),
            nn.ReLU(),
            nn.Linear(hidden, 3),
        )
        nn.init.zeros_(head.weight[:1])
        nn.init.zeros_(head.bias[:1])
        self.log_sharpness = nn.Parameter(torch.tensor(math.log(configuration.sharpness_m)))

    def _apply(self, change: Callable[[Tensor], Tensor], recurse: bool = True) -> CanonicalGrid:
        """What torch moves a module with; the grids go where the tables go."""
        super()._apply(change, recurse)
        device = self.log_sharpness.device
        self.grids = [
            grid if grid.origin.device == device else grid.to(device) for grid in self.grids
        ]
        return self

    def features(self, points: Tensor) -> Tensor:
        """Canonical points (P, 3) -> (P, levels x channels)."""
        one_grid = torch.zeros(len(points), dtype=torch.int64, device=points.device)
        found = []
        for grid, table in zip(self.grids, self.tables, strict=True):
            numbers, weights = grid.corners(points, one_grid)
            found.append(weighted_rows(table, numbers, weights))
        return torch.cat(found, -1)

    def offset_m(self, head: Tensor) -> Tensor:
        """How far the learned surface lies outside the prior's, bounded, metres."""
        out, deep = self.configuration.largest_offset_m, self.configuration.deepest_offset_m
        return torch.where(head > 0, out * torch.tanh(head / out), deep * torch.tanh(head / deep))

    def forward(
        self, points: Tensor, appearance: Tensor, facing: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Colour and density of canonical points.

        Args:
            points: (P, 3) canonical metres.
            appearance: (P, A) codes of the samples' images.
            facing: (P, 3) unit normals in world space at the samples' moments.

        Returns:
            rgb (P, 3), density (P,) in 1/m, and the surface's offset (P,) in metres.
        """
        head = self.geometry(self.features(points))
        offset = self.offset_m(head[:, 0])
        unshaded = torch.sigmoid(self.colour(torch.cat([head[:, 1:], appearance], -1)))
        return unshaded * self.light(facing), self.density(self.prior(points) - offset), offset

    def density(self, signed_distance: Tensor) -> Tensor:
        """Density (1/m) from a signed distance (m): Laplace's distribution function over width.

        Source: VolSDF (Yariv et al. 2021), eqs. 2-3. Both branches decay, so neither overflows.
        """
        width = self.log_sharpness.exp().clamp_min(2e-3)
        decay = 0.5 * torch.exp(-signed_distance.abs() / width)
        return torch.where(signed_distance > 0, decay, 1.0 - decay) / width


def nested_grids(
    prior: SignedDistancePrior, outside_m: float, inside_m: float, configuration: CanonicalConfig
) -> list[SparseGrids]:
    """Nested sparse grids around the canonical surface, coarse to fine.

    Args:
        outside_m, inside_m: how far from the prior's surface the field will be asked.
    """
    size = torch.tensor(prior.lattice.shape) * prior.spacing
    grids = []
    for level in reversed(range(configuration.levels)):
        spacing = configuration.finest_m * configuration.level_ratio**level
        shape = torch.ceil(size / spacing).long() + 1
        axes = [prior.origin[a] + spacing * torch.arange(int(shape[a])) for a in range(3)]
        points = torch.stack(torch.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        # A point that is asked for must find all eight corners of its cell.
        corner_reach = math.sqrt(3.0) * spacing
        distance = prior(points)
        occupied = (distance < outside_m + corner_reach) & (distance > -inside_m - corner_reach)
        numbers = torch.cumsum(occupied, 0, dtype=torch.int32) - 1
        grids.append(
            SparseGrids(
                prior.origin[None],
                shape[None],
                torch.zeros(1, dtype=torch.int64),
                torch.where(occupied, numbers, -1).int(),
                spacing,
            )
        )
    return grids
