"""Shading by a light that stands still while the person moves.

A canonical point that turns away from the light darkens. Without this the darkening would have to
go into colour or density, and would be wrong from every other side.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

_TERMS = 8  # real spherical harmonics of degree 1 and 2; degree 0 belongs to the colour


class FixedLight(nn.Module):
    """Brightness by the direction that a surface faces, in logits of the colour.

    Starts at no shading. Source: irradiance is a degree-2 spherical harmonic of the normal to
    within a few percent (Ramamoorthi and Hanrahan 2001).
    """

    def __init__(self) -> None:
        super().__init__()
        self.coefficients = nn.Parameter(torch.zeros(_TERMS, 3))

    def forward(self, facing: Tensor) -> Tensor:
        """Unit normals in world space (P, 3) -> change of the colour's logits (P, 3)."""
        x, y, z = facing.unbind(-1)
        terms = torch.stack(
            [x, y, z, x * y, y * z, x * z, x * x - y * y, 3.0 * z * z - 1.0], -1
        )
        return terms @ self.coefficients
