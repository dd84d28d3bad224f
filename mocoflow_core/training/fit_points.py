"""Points that the motion is fitted to: on the body with their partners, and in free space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.body.signed_distance import signed_distance_lattice
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.frame_box import FrameBoxes

# Fine enough to tell inside from outside at a margin of a few centimetres.
_SPACING_M = 0.05


@dataclass(frozen=True, eq=False)
class DrawnPoints:
    """Points of one moment, world metres."""

    observed: Tensor  # (P, 3) on the body at that moment
    canonical: Tensor  # (P, 3) the same points of the canonical body
    free: Tensor  # (Q, 3) in the moment's box, where nothing is


class FitPoints:
    """The meshes of the training frames, ready to be drawn from."""

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.int32],
        canonical: NDArray[np.float32],
        boxes: FrameBoxes,
        losses: LossConfig,
    ) -> None:
        """Args: vertices (F, V, 3) at the training frames, boxes with a row for each of them."""
        self.vertices = torch.from_numpy(vertices)
        self.faces = faces
        self.canonical = torch.from_numpy(canonical)
        self.boxes = boxes
        self.losses = losses
        self._distances: dict[int, SignedDistancePrior] = {}

    def draw(self, row: int, generator: torch.Generator) -> DrawnPoints:
        """Random vertices, and random places of the box that are farther from the mesh than the
        margin."""
        count = self.losses.fit_points
        chosen = torch.randint(len(self.canonical), (count,), generator=generator)
        lower, upper = self.boxes.lower[row], self.boxes.upper[row]
        share = torch.rand(count, 3, generator=generator)
        places = (lower + share * (upper - lower)) @ self.boxes.rotation
        free = places[self._distance(row)(places) > self.losses.free_margin_m]
        return DrawnPoints(self.vertices[row][chosen], self.canonical[chosen], free)

    def _distance(self, row: int) -> SignedDistancePrior:
        """Signed distance from one moment's mesh, made when it is first asked for."""
        if row not in self._distances:
            margin = self.losses.free_margin_m + 2.0 * _SPACING_M
            vertices = self.vertices[row].numpy()
            origin, lattice = signed_distance_lattice(vertices, self.faces, _SPACING_M, margin)
            found = SignedDistancePrior(
                torch.from_numpy(lattice), torch.from_numpy(origin), _SPACING_M
            )
            self._distances[row] = found
        return self._distances[row]
