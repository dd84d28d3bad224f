"""Sparse grids of nodes near a surface, and trilinear look-ups in them.

The nodes of a regular lattice that lie near something are numbered; a dense map from lattice
position to number finds them again. Many grids (one per frame) share one flat map, so that a batch
of points from many frames is one look-up.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

# Offsets of the eight corners of a lattice cell, in the order that the weights use.
_CORNERS = torch.tensor(
    [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=torch.int64
)


@dataclass(frozen=True, eq=False)
class SparseGrids:
    """G sparse lattices with one spacing.

    ``node_map`` holds, for each lattice position of each grid, the number of its node, or -1.
    """

    origin: Tensor  # (G, 3) position of lattice point (0, 0, 0), metres
    shape: Tensor  # (G, 3) int64 lattice points along each axis
    offset: Tensor  # (G,) int64 start of the grid in node_map
    node_map: Tensor  # (sum of lattice points,) int32
    spacing: float  # metres

    @property
    def count(self) -> int:
        return self.origin.shape[0]

    def to(self, device: torch.device) -> SparseGrids:
        parts = (self.origin, self.shape, self.offset, self.node_map)
        return SparseGrids(*(part.to(device) for part in parts), self.spacing)

    def tensors(self) -> dict[str, Tensor]:
        """All content as named tensors, for saving."""
        return {
            "origin": self.origin,
            "shape": self.shape,
            "offset": self.offset,
            "node_map": self.node_map,
            "spacing": torch.tensor([self.spacing], dtype=torch.float64),
        }

    @classmethod
    def from_tensors(cls, tensors: dict[str, Tensor]) -> SparseGrids:
        return cls(
            tensors["origin"],
            tensors["shape"],
            tensors["offset"],
            tensors["node_map"],
            float(tensors["spacing"]),
        )

    def _lattice(self, points: Tensor, grid: Tensor) -> Tensor:
        return (points - self.origin[grid]) / self.spacing

    def _numbers(self, position: Tensor, grid: Tensor) -> Tensor:
        """Node numbers at integer lattice positions (..., 3); -1 outside."""
        shape = self.shape[grid]
        inside = ((position >= 0) & (position < shape)).all(-1)
        flat = (position[..., 0] * shape[..., 1] + position[..., 1]) * shape[..., 2]
        flat = self.offset[grid] + flat + position[..., 2]
        numbers = self.node_map[torch.where(inside, flat, 0)].long()
        return torch.where(inside, numbers, -1)

    def has_node(self, points: Tensor, grid: Tensor) -> Tensor:
        """Whether the lattice point nearest to each point (P, 3) of grid (P,) is a node."""
        return self._numbers(torch.round(self._lattice(points, grid)).long(), grid) >= 0

    def corners(self, points: Tensor, grid: Tensor) -> tuple[Tensor, Tensor]:
        """Numbers (P, 8) and trilinear weights (P, 8) of the nodes around each point.

        Missing nodes get weight zero and the rest is scaled up to sum to one; a point with no
        node around it has all weights zero. Differentiable in ``points`` through the weights.
        """
        lattice = self._lattice(points, grid)
        base = torch.floor(lattice.detach())
        fraction = lattice - base
        corner = _CORNERS.to(points.device)
        numbers = self._numbers(base.long()[:, None] + corner, grid[:, None])
        sides = torch.stack([1.0 - fraction, fraction], 1)  # (P, 2, 3)
        weights = (sides[:, :, None, None, 0] * sides[:, None, :, None, 1]).squeeze(-1)[..., None]
        weights = (weights * sides[:, None, None, :, 2]).reshape(-1, 8)
        weights = weights * (numbers >= 0)
        total = weights.sum(-1, keepdim=True)
        scaled = weights / total.clamp_min(torch.finfo(weights.dtype).tiny)
        return numbers.clamp_min(0), torch.where(total > 0, scaled, weights)


def gather(table: Tensor, numbers: Tensor, weights: Tensor) -> Tensor:
    """Weighted sums of table rows: (N, C), (P, 8), (P, 8) -> (P, C)."""
    return torch.nn.functional.embedding_bag(
        numbers, table, per_sample_weights=weights, mode="sum"
    )
