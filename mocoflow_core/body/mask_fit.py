"""Repair a body estimate before any training: bend its joints until its outline fits the masks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from torch import Tensor

from mocoflow_core.body.articulation import Articulation, articulate
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.outline import EdgeTopology, MaskOutline, match_outlines
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.se3 import exp_se3

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]


class MaskFitConfig(ConfigurationPart):
    """What is usual of body estimators and masks, and how long to search."""

    parts: int = Field(32, ge=1, description="Rigid parts looked for in the mesh's motion.")
    blend_m: float = Field(0.04, gt=0, description="Motion is blended so far across a joint.")
    joint_error_deg: float = Field(4.0, gt=0, description="Usual error about each axis of a joint.")
    stiff_error_deg: float = Field(0.3, gt=0, description="The same where the mesh never bends.")
    root_error_m: float = Field(0.02, gt=0, description="Usual error of the body's place.")
    error_seconds: float = Field(0.5, gt=0, description="How long an error stays alike.")
    outline_error_m: float = Field(0.01, gt=0, description="Usual distance of right outlines.")
    outlier_m: float = Field(0.06, gt=0, description="Points farther off than this count less.")
    clothes_m: float = Field(0.01, gt=0, description="Usual standing off of clothes from the mesh.")
    independent_points: int = Field(
        60, ge=1, description="Parts of one frame's outline that err on their own."
    )
    outline_points: int = Field(240, ge=8, description="Points taken on each mask's outline.")
    turn_m: float = Field(0.10, gt=0, description="Distance that a turn of 60 degrees is worth.")
    least_agreement: float = Field(0.3, ge=-1, le=1, description="Cosine of matching outlines.")
    rounds: int = Field(12, ge=1, description="Searches of matching points.")
    steps: int = Field(12, ge=1, description="Optimiser steps after each search.")
    rate: float = Field(0.06, gt=0, description="Adam's first rate, in usual errors; falls to 0.")


def fit_to_masks(
    clip: Clip, meshes: MeshSequence, configuration: MaskFitConfig, progress: Progress
) -> MeshSequence:
    """The meshes with their joints and place corrected towards the masks of the training frames.

    The correction is the likeliest one: each joint errs by a few degrees, smoothly in time, bones
    keep their lengths. Held-out frames, whose masks are not looked at, and frames between get the
    correction of the moment. Without any mask to fit the meshes come back as they were.

    Args:
        clip: of the camera trained on.
        meshes: world metres; holds every frame of the clip.
    """
    training = ~clip.held_out & clip.has_mask
    training &= clip.masks.reshape(len(clip.masks), -1).any(axis=1)
    if not training.any():
        return meshes
    frames = clip.frame_indices[training]
    outlines = [MaskOutline.of(mask, configuration.outline_points) for mask in clip.masks[training]]
    skeleton = articulate(
        meshes.vertices, meshes.faces, configuration.parts, configuration.blend_m
    )
    correction = _Correction(skeleton, meshes, clip, frames, configuration)
    rows = np.searchsorted(meshes.frame_indices, frames)
    topology = EdgeTopology.of(meshes.faces)
    _optimise(correction, rows, outlines, topology, clip.camera, configuration, progress)
    with torch.no_grad():
        return replace(meshes, vertices=correction.vertices(np.arange(len(meshes.vertices))))


class _Correction:
    """Whitened unknowns: all of usual size one. Angles and shifts are smooth mixtures of them."""

    def __init__(
        self,
        skeleton: Articulation,
        meshes: MeshSequence,
        clip: Clip,
        frames: NDArray[np.int32],
        configuration: MaskFitConfig,
    ) -> None:
        self.skeleton = skeleton
        self.meshes = meshes
        mixing = _smooth_mixing(meshes.frame_indices, frames, clip, configuration.error_seconds)
        self._mixing = torch.from_numpy(mixing).float()
        least, most = np.radians([configuration.stiff_error_deg, configuration.joint_error_deg])
        angles = np.clip(skeleton.bend, least, most)
        angles[0] = most
        self._angles = torch.from_numpy(angles).float()[:, None]
        self._root_m = configuration.root_error_m
        self._clothes_m = configuration.clothes_m
        self._bases = torch.from_numpy(skeleton.bases).float()
        self._pivots = torch.from_numpy(skeleton.pivots).float()
        self._weights = torch.from_numpy(skeleton.weights).float()
        self._places = torch.from_numpy(meshes.vertices)
        self._levels = _levels(skeleton.parents)
        parts = len(skeleton.parents)
        self.turns = torch.zeros(len(frames), parts, 3, requires_grad=True)
        self.shifts = torch.zeros(len(frames), 3, requires_grad=True)
        self.clothes = torch.zeros(parts, requires_grad=True)

    def unknowns(self) -> list[Tensor]:
        return [self.turns, self.shifts, self.clothes]

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
            turned = torch.cat(
                [turned[..., :3], turned[..., 3:] + above[..., 3:]], -1
            )
            placed = torch.cat([placed, turned], 1)
        return placed

    def vertices(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        transforms = self.transforms(rows)
        moved = [
            _blend(self._weights, transform, points)
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


def _blend(weights: Tensor, transforms: Tensor, points: Tensor) -> Tensor:
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


def _smooth_mixing(
    all_frames: NDArray[np.int32], frames: NDArray[np.int32], clip: Clip, seconds: float
) -> Array:
    """(T, S): turns independent unknowns at S frames into errors that stay alike for ``seconds``.

    A row has length one, so that the errors keep the unknowns' usual size.
    """
    kept = clip.frame_indices[~clip.held_out]
    stride = float(np.median(np.diff(kept))) if len(kept) > 1 else 1.0
    lag = (all_frames[:, None] - frames[None]) / (stride * clip.fps * seconds)
    mixing = np.exp(-np.minimum(lag**2, 200.0))
    return mixing / np.maximum(np.linalg.norm(mixing, axis=1, keepdims=True), 1e-3)


@dataclass(frozen=True, eq=False)
class _Targets:
    """Matching points of all frames, padded; a weight of zero is padding."""

    weights: Tensor  # (T, M, P)
    places: Tensor  # (T, M, 3) world metres, before the correction
    pixels: Tensor  # (T, M, 2)
    normals: Tensor  # (T, M, 2)
    share: Tensor  # (T, M)


def _find_targets(
    correction: _Correction,
    rows: NDArray[np.int64],
    outlines: list[MaskOutline],
    topology: EdgeTopology,
    camera: Camera,
    configuration: MaskFitConfig,
) -> _Targets:
    with torch.no_grad():
        posed = correction.vertices(rows)
    focal = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    found = []
    for vertices, mask in zip(posed, outlines, strict=True):
        body = topology.outline(vertices, camera)
        depth = float(np.median(body.depth)) if len(body.depth) else 1.0
        pairs = match_outlines(
            body, mask, configuration.turn_m * focal / depth, configuration.least_agreement
        )
        found.append((body.edges[pairs.body], mask.pixels[pairs.mask], mask.normals[pairs.mask]))
    most = max(1, max(len(edges) for edges, _, _ in found))
    edges = np.zeros((len(rows), most, 2), np.int64)
    targets = np.zeros((len(rows), most, 5), np.float32)
    for row, (pairs_edges, pixels, normals) in enumerate(found):
        count = len(pairs_edges)
        edges[row, :count] = pairs_edges
        targets[row, :count] = np.concatenate(
            [pixels, normals, np.full((count, 1), 1.0 / max(count, 1))], axis=1
        )
    pixels, normals, share = torch.from_numpy(targets).split((2, 2, 1), -1)
    return _Targets(*correction.gather(rows, edges), pixels, normals, share[..., 0])


def _optimise(
    correction: _Correction,
    rows: NDArray[np.int64],
    outlines: list[MaskOutline],
    topology: EdgeTopology,
    camera: Camera,
    configuration: MaskFitConfig,
    progress: Progress,
) -> None:
    optimiser = torch.optim.Adam(correction.unknowns(), configuration.rate)
    steps = configuration.rounds * configuration.steps
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda step: 0.5 * (1.0 + np.cos(np.pi * step / steps))
    )
    for attempt in range(configuration.rounds):
        progress(attempt / configuration.rounds, "fitting the body to the masks")
        targets = _find_targets(correction, rows, outlines, topology, camera, configuration)
        for _ in range(configuration.steps):
            optimiser.zero_grad()
            loss = correction.surprise() + _misfit(
                correction, rows, targets, camera, configuration
            )
            loss.backward()
            optimiser.step()
            schedule.step()


def _misfit(
    correction: _Correction,
    rows: NDArray[np.int64],
    targets: _Targets,
    camera: Camera,
    configuration: MaskFitConfig,
) -> Tensor:
    """Squared distances between the outlines over their usual square; far ones count less."""
    rotation, shift, intrinsics = (
        torch.from_numpy(np.asarray(part)).float() for part in (camera.R, camera.t, camera.K)
    )
    world = _blend(targets.weights, correction.transforms(rows), targets.places)
    points = world @ rotation.T + shift
    depth = points[..., 2:].clamp_min(0.05)
    pixels = (points @ intrinsics.T)[..., :2] / depth
    focal = intrinsics.diagonal()[:2]
    off = ((pixels - targets.pixels) / focal * depth * targets.normals).sum(-1)
    off = off + correction.stand_off(targets.weights)
    squared = off * off
    robust = squared / (1.0 + squared / configuration.outlier_m**2)
    per_frame = (targets.share * robust).sum(-1)
    return (
        0.5 * configuration.independent_points / configuration.outline_error_m**2 * per_frame.sum()
    )
