"""Sparse grids of nodes near a surface, and trilinear look-ups in them.

The nodes of a regular lattice that lie near something are numbered; a dense map from lattice
position to number finds them again. Many grids (one per frame) share one flat map, so that a batch
of points from many frames is one look-up.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.autograd.function import BackwardCFunction, FunctionCtx

# Offsets of the eight corners of a lattice cell, in the order that the weights use.
_CORNERS = torch.tensor(
    [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=torch.int64
)


Corners = tuple[Tensor, Tensor]  # numbers (P, 8) of nodes and their weights (P, 8)


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
        return SparseGrids(
            self.origin.to(device),
            self.shape.to(device),
            self.offset.to(device),
            self.node_map.to(device),
            self.spacing,
        )

    def shared_by(self, count: int) -> SparseGrids:
        """``count`` grids that are all this one."""
        origin, shape = self.origin.expand(count, 3), self.shape.expand(count, 3)
        return SparseGrids(origin, shape, self.offset.expand(count), self.node_map, self.spacing)

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

    def boxes(self) -> tuple[Tensor, Tensor]:
        """Lower and upper corners (G, 3) of the lattices."""
        return self.origin, self.origin + self.spacing * (self.shape - 1)

    def _lattice(self, points: Tensor, grid: Tensor) -> Tensor:
        """Lattice coordinates (P, 3), moved onto the border from outside.

        Lattices reach beyond their nodes, so nothing on the border is near a node.
        """
        coordinates = (points - self.origin[grid]) / self.spacing
        return torch.minimum(coordinates, (self.shape[grid] - 1).to(points)).clamp_min(0.0)

    def _flat(self, position: Tensor, grid: Tensor) -> Tensor:
        """Index in ``node_map`` of integer lattice positions (P, 3) of grids (P,)."""
        shape = self.shape[grid]
        x, y, z = position.unbind(-1)
        return self.offset[grid] + (x * shape[:, 1] + y) * shape[:, 2] + z

    def flat_nearest(self, points: Tensor, grid: Tensor) -> Tensor:
        """Index (P,) in ``node_map`` of the lattice point nearest to each point (P, 3)."""
        nearest = torch.round(self._lattice(points, grid)).long()
        return self._flat(nearest.clamp_min(0), grid)

    def corners(self, points: Tensor, grid: Tensor) -> Corners:
        """Numbers (P, 8) and trilinear weights (P, 8) of the nodes around each point.

        Missing nodes get weight zero and the rest is scaled up to sum to one; a point with no
        node around it has all weights zero. Differentiable in ``points`` through the weights.
        A point that is not finite gets weights that are not: whoever watches the loss sees it.
        """
        lattice = self._lattice(points, grid)
        base = torch.minimum(lattice.detach().long(), self.shape[grid] - 2).clamp_min(0)
        far = lattice - base
        near = 1.0 - far
        (x0, y0, z0), (x1, y1, z1) = near.unbind(-1), far.unbind(-1)
        xy = torch.stack([x0 * y0, x0 * y1, x1 * y0, x1 * y1], -1)
        weights = torch.stack([xy * z0[:, None], xy * z1[:, None]], -1).flatten(1)
        numbers = self.node_map[self._flat(base, grid)[:, None] + self._corner_steps()[grid]]
        known = numbers >= 0
        weights = weights * known
        total = weights.sum(-1, keepdim=True)
        # A point exactly on a missing corner has total zero and stays unknown.
        scaled = weights / total.clamp_min(torch.finfo(weights.dtype).tiny)
        return numbers.clamp_min(0).long(), scaled

    def _corner_steps(self) -> Tensor:
        """Steps (G, 8) in ``node_map`` from a cell's first corner to each of its corners."""
        rows = torch.stack([self.shape[:, 1] * self.shape[:, 2], self.shape[:, 2]], -1)
        strides = torch.cat([rows, torch.ones_like(rows[:, :1])], -1)
        return strides @ _CORNERS.to(strides.device).T


class WeightedRows(torch.autograd.Function):
    """Weighted sums of table rows: table (N, C), numbers (P, 8), weights (P, 8) -> (P, C).

    What ``(table[numbers] * weights[..., None]).sum(1)`` computes, without the (P, 8, C)
    intermediate in the forward pass.
    """

    @staticmethod
    def forward(ctx: FunctionCtx, table: Tensor, numbers: Tensor, weights: Tensor) -> Tensor:
        ctx.save_for_backward(table, numbers, weights)
        return torch.nn.functional.embedding_bag(
            numbers, table, per_sample_weights=weights, mode="sum"
        )

    @staticmethod
    def backward(
        ctx: BackwardCFunction, gradient: Tensor
    ) -> tuple[Tensor | None, None, Tensor | None]:
        # Torch's own types say that there is one of each.
        saved: tuple[Tensor, ...] = ctx.saved_tensors
        needed: tuple[bool, ...] = ctx.needs_input_grad
        table, numbers, weights = saved
        for_table = for_weights = None
        if needed[0]:
            spread = weights[..., None] * gradient[:, None]
            for_table = torch.zeros_like(table).index_add_(
                0, numbers.flatten(), spread.flatten(0, 1)
            )
        if needed[2]:
            for_weights = (table[numbers] @ gradient[..., None])[..., 0]
        return for_table, None, for_weights


def weighted_rows(table: Tensor, numbers: Tensor, weights: Tensor) -> Tensor:
    """Differentiable weighted sums of table rows, (P, C); see ``WeightedRows``."""
    return WeightedRows.apply(table, numbers, weights)
