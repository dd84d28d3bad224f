"""What a trained scene's canonical space holds: density, colour, and where its surface is.

A surface stands where a typical step along a ray through it becomes more than half opaque. Each
representation says which density that is, where rays would ever meet density, and what colour a
point has that belongs to no moment: by the mean appearance code, under the mean of the light.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.network_field import NetworkField

Corners = tuple[NDArray[np.float64], NDArray[np.float64]]  # lower (3,) and upper (3,), metres


class CanonicalScene(Protocol):
    """Density and colour at canonical points, whatever they are made of."""

    box: Corners  # outside of it is nothing
    surface_density: float  # per metre

    def density(self, points: Tensor) -> Tensor:
        """Density (P,) in 1/m at canonical points (P, 3); zero where rendering never looks."""

    def colour(self, points: Tensor, looking: Tensor) -> Tensor:
        """rgb (P, 3) in [0, 1], sRGB-encoded, of canonical points that are looked at along unit
        directions (P, 3)."""


class ShellCanonical:
    """The hybrid field in its shell.

    Its density is Laplace's distribution function over a signed distance from the learned surface:
    half of its maximum stands at distance zero, whatever the width of the edge. A ray that falls
    straight onto it is half opaque a third of that width, some 2 mm, farther in.

    Colours are lit as by the mean over all directions: one colour stands for every pose, and the
    body turns under its light.
    """

    def __init__(
        self, field: HybridField, vertices: NDArray[np.float32], shell_width_m: float
    ) -> None:
        """Args: vertices (V, 3) of the canonical mesh, world metres."""
        self._grid = field.canonical
        self._appearance = field.appearance.mean(0)
        self._shell_width_m = shell_width_m
        self.box = _around(vertices, shell_width_m)
        self.surface_density = float(self._grid.density(torch.zeros(1)))

    def density(self, points: Tensor) -> Tensor:
        distance = self._grid.prior(points)
        head = self._grid.geometry(self._grid.features(points))
        found = self._grid.density(distance - self._grid.offset_m(head[:, 0]))
        return torch.where(distance < self._shell_width_m, found, 0.0)

    def colour(self, points: Tensor, looking: Tensor) -> Tensor:
        no_side = torch.zeros_like(points)  # of which the light knows only its mean
        return self._grid(points, self._appearance.expand(len(points), -1), no_side)[0]


class BoxCanonical:
    """The paper's fine network in the canonical body's box.

    Its density has no maximum, so the length of a step decides: the mean distance between the
    evenly spread samples of a ray, and the density that makes such a step half opaque.
    """

    def __init__(
        self, field: NetworkField, vertices: NDArray[np.float32], margin_m: float, step_m: float
    ) -> None:
        """Args: vertices (V, 3) of the canonical mesh, world metres; margin_m around its box."""
        self._field = field
        self._appearance = field.appearance.mean(0)
        self.box = _around(vertices, margin_m)
        self.surface_density = math.log(2.0) / step_m

    def density(self, points: Tensor) -> Tensor:
        return self._field.density(self._field.fine, points)[0]

    def colour(self, points: Tensor, looking: Tensor) -> Tensor:
        network = self._field.fine
        _, hidden = self._field.density(network, points)
        return network.colour(hidden, self._appearance.expand(len(points), -1), looking)


def _around(vertices: NDArray[np.float32], margin_m: float) -> Corners:
    points = vertices.astype(np.float64)
    return points.min(0) - margin_m, points.max(0) + margin_m
