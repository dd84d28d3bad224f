"""The canonical mesh's signed distance as a field: where density starts from."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class SignedDistancePrior(nn.Module):
    """Trilinear look-up of a lattice of signed distances (negative inside), metres."""

    lattice: Tensor
    origin: Tensor

    def __init__(self, lattice: Tensor, origin: Tensor, spacing: float) -> None:
        """Args: lattice (X, Y, Z), origin (3,) of its first point, spacing in metres."""
        super().__init__()
        self.spacing = spacing
        self.register_buffer("lattice", lattice, persistent=False)
        self.register_buffer("origin", origin, persistent=False)

    def _look_up(self, volume: Tensor, points: Tensor) -> Tensor:
        size = torch.tensor(volume.shape[-3:], device=points.device, dtype=points.dtype)
        unit = 2.0 * (points - self.origin) / (self.spacing * (size - 1.0)) - 1.0
        # grid_sample wants the last axis of the volume first.
        grid = unit.flip(-1)[None, None, None]
        found = torch.nn.functional.grid_sample(
            volume[None], grid, padding_mode="border", align_corners=True
        )
        return found[0, :, 0, 0].T

    def forward(self, points: Tensor) -> Tensor:
        """Canonical points (P, 3) -> signed distance (P,), clamped to the lattice's border."""
        return self._look_up(self.lattice[None], points)[:, 0]

    def normals(self, points: Tensor) -> Tensor:
        """Unit outward normals (P, 3) at canonical points (P, 3)."""
        gradient = torch.stack(torch.gradient(self.lattice, spacing=self.spacing))
        return torch.nn.functional.normalize(self._look_up(gradient, points), dim=-1)
