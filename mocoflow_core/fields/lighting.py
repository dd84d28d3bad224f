"""Shading by a light that stands still while the person moves.

A point of the skin that turns away from the light darkens. Without this the darkening would have
to go into colour or density, and would be wrong from every other side.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

_GAMMA = 2.2  # of the sRGB encoding, near enough for a change of brightness


class FixedLight(nn.Module):
    """Brightness ``1 + b . normal`` in linear light, scaled to at most one.

    ``b`` is measured before training (``body/light.py``), because pixels at grazing sights would
    pull a learned one to the wrong side. Zero leaves colours as they are.
    """

    light: Tensor

    def __init__(self, light: tuple[float, float, float]) -> None:
        super().__init__()
        self.register_buffer("light", torch.tensor(light), persistent=False)
        self.brightest = 1.0 + float(self.light.norm())

    def forward(self, facing: Tensor) -> Tensor:
        """Unit normals in world space (P, 3) -> factor on sRGB-encoded colours (P, 1) in (0, 1]."""
        brightness = (1.0 + facing @ self.light) / self.brightest
        return brightness.clamp_min(1e-3)[:, None] ** (1.0 / _GAMMA)
