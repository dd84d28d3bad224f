"""A smooth correction of a body's joints and place, and of its size."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.body.articulation import Articulation
from mocoflow_core.geometry.se3 import exp_se3

Array = NDArray[np.float64]


class JointCorrection:
    """Whitened unknowns: all of usual size one. Angles and shifts are smooth mixtures of them."""

    def __init__(
        self,
        skeleton: Articulation,
        vertices: NDArray[np.float32],
        mixing: Array,
        angles: Array,
        root_m: float,
        size: float,
        clothes_m: float,
    ) -> None:
        """Start without any correction.

        Args:
            vertices: (T, V, 3) the estimate, world metres.
            mixing: (T, S) of ``smooth_mixing``.
            angles: (P,) usual error of each joint about each axis, radians.
            root_m: usual error of the body's place.
            size: usual error of the body's size, as a logarithm.
            clothes_m: usual distance of clothes from the mesh.
        """
        self._mixing = torch.from_numpy(mixing).float()
        self._angles = torch.from_numpy(angles).float()[:, None]
        self._root_m = root_m
        self._size = size
        self._clothes_m = clothes_m
        self._bases = torch.from_numpy(skeleton.bases).float()
        self._pivots = torch.from_numpy(skeleton.pivots).float()
        self._weights = torch.from_numpy(skeleton.weights).float()
        self._places = torch.from_numpy(vertices)
        self._levels = _levels(skeleton.parents)
        parts = len(skeleton.parents)
        self.turns = torch.zeros(mixing.shape[1], parts, 3, requires_grad=True)
        self.shifts = torch.zeros(mixing.shape[1], 3, requires_grad=True)
        self.size = torch.zeros(1, requires_grad=True)
        self.clothes = torch.zeros(parts, requires_grad=True)

    def unknowns(self) -> list[Tensor]:
        """What is searched."""
        every = [self.turns, self.shifts, self.size, self.clothes]
        return [unknown for unknown in every if unknown.requires_grad]

    def doubt_size(self, least: float) -> None:
        """Take the given size for right from now on if the error found so far is below a share."""
        if abs(float(self._size * self.size.detach())) < least:
            self.size = torch.zeros(1)

    def surprise(self) -> Tensor:
        """Minus the logarithm of how likely such errors are."""
        return 0.5 * sum(((part * part).sum() for part in self.unknowns()), torch.zeros(()))

    def transforms(self, rows: NDArray[np.int64]) -> Tensor:
        """What moves each part (T, P, 3, 4) at the given frames of the mesh sequence."""
        mixing = self._mixing[rows]
        local = torch.einsum("ts,spc->tpc", mixing, self.turns) * self._angles
        # Angles live in the parent's axes: an error stays alike while the body turns.
        omega = torch.einsum("tpij,tpj->tpi", self._bases[rows], local)
        rotation, _ = exp_se3(torch.cat([omega, torch.zeros_like(omega)], -1))
        pivots = self._pivots[rows]
        about = pivots - (rotation @ pivots[..., None])[..., 0]
        own = torch.cat([rotation, about[..., None]], -1)
        move = self._root_m * (mixing @ self.shifts)
        root = torch.cat([own[:, :1, :, :3], own[:, :1, :, 3:] + move[:, None, :, None]], -1)
        placed = root
        for part, parent in self._levels:
            above, below = placed[:, parent], own[:, part]
            turned = above[..., :3] @ below
            turned = torch.cat([turned[..., :3], turned[..., 3:] + above[..., 3:]], -1)
            placed = torch.cat([placed, turned], 1)
        return self._sized(placed, pivots[:, 0] + move)

    def _sized(self, placed: Tensor, centres: Tensor) -> Tensor:
        """The whole body larger or smaller about its root (T, 3), all frames alike."""
        scale = torch.exp(self._size * self.size)
        centre = centres[:, None, :, None]
        return torch.cat([scale * placed[..., :3], centre + scale * (placed[..., 3:] - centre)], -1)

    def vertices(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        transforms = self.transforms(rows)
        moved = [
            blend(self._weights, transform, points)
            for transform, points in zip(transforms, self._places[rows], strict=True)
        ]
        return torch.stack(moved).numpy()

    def gather(self, rows: NDArray[np.int64], edges: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
        """Weights (T, M, P) and estimated places (T, M, 3) of edge middles ``edges`` (T, M, 2)."""
        weights = self._weights[edges].mean(2)
        frames = torch.from_numpy(rows)[:, None, None]
        return weights, self._places[frames, torch.from_numpy(edges)].mean(2)

    def stand_off(self, weights: Tensor) -> Tensor:
        """How far (T, M) clothes stand off the mesh, metres."""
        return self._clothes_m * (weights @ self.clothes)


def blend(weights: Tensor, transforms: Tensor, points: Tensor) -> Tensor:
    """Points (..., M, 3) moved by the weighted mean (..., M, P) of transforms (..., P, 3, 4)."""
    mixed = (weights @ transforms.flatten(-2)).unflatten(-1, (3, 4))
    return (mixed[..., :3] @ points[..., None])[..., 0] + mixed[..., 3]


def _levels(parents: NDArray[np.int64]) -> list[tuple[Tensor, Tensor]]:
    """Parts by generation below the root, whose order is kept, each with its parents."""
    depth = np.zeros(len(parents), np.int64)
    for part in range(1, len(parents)):
        depth[part] = depth[parents[part]] + 1
    return [
        (torch.from_numpy(members), torch.from_numpy(parents[members]))
        for members in (np.flatnonzero(depth == level) for level in range(1, depth.max() + 1))
    ]


def smooth_mixing(times: Array, known: Array, lasting: float) -> Array:
    """(T, S): turns independent unknowns at ``known`` (S,) into errors at ``times`` (T,).

    They stay alike for about ``lasting``, all in seconds.
    A row has length one, so that the errors keep the unknowns' usual size.
    """
    lag = (times[:, None] - known[None]) / lasting
    mixing = np.exp(-np.minimum(lag**2, 200.0))
    return mixing / np.maximum(np.linalg.norm(mixing, axis=1, keepdims=True), 1e-3)
