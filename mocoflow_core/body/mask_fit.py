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
from mocoflow_core.body.joint_correction import JointCorrection, blend, smooth_mixing
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.outline import (
    BodyOutline,
    EdgeTopology,
    MaskOutline,
    Matches,
    match_outlines,
)
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.threads import torch_threads

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

# Gradients of whitened unknowns are of size one or more where they say anything; smaller ones are
# not blown up to full steps.
_ADAM_EPSILON = 1.0


class MaskFitConfig(ConfigurationPart):
    """What is usual of body estimators and masks, and how long to search."""

    parts: int = Field(32, ge=1, description="Rigid parts looked for in the mesh's motion.")
    blend_m: float = Field(0.04, gt=0, description="Motion is blended so far across a joint.")
    joint_error_deg: float = Field(4.0, gt=0, description="Usual error about each axis of a joint.")
    stiff_error_deg: float = Field(0.3, gt=0, description="The same where the mesh never bends.")
    root_error_m: float = Field(0.02, gt=0, description="Usual error of the body's place.")
    error_seconds: float = Field(0.5, gt=0, description="How long an error stays alike.")
    outline_error_m: float = Field(0.02, gt=0, description="Usual distance of right outlines.")
    outlier_m: float = Field(0.08, gt=0, description="Points farther off count less, at first.")
    last_outlier_m: float = Field(0.02, gt=0, description="The same in the last round.")
    agreeing_px: float = Field(
        0.5, ge=0, description="Outlines that agree so well, in three quarters of their points."
    )
    apart_px: float = Field(
        1.5,
        gt=0,
        description="Outlines so far apart show errors of the usual size.",
    )
    clothes_m: float = Field(0.02, gt=0, description="Usual standing off of clothes from the mesh.")
    independent_points: int = Field(
        60, ge=1, description="Parts of one frame's outline that err on their own."
    )
    outline_points: int = Field(240, ge=8, description="Points taken on each mask's outline.")
    turn_m: float = Field(0.05, gt=0, description="Distance that a turn of 60 degrees is worth.")
    least_agreement: float = Field(0.3, ge=-1, le=1, description="Cosine of matching outlines.")
    rounds: int = Field(12, ge=1, description="Searches of matching points.")
    steps: int = Field(12, ge=1, description="Optimiser steps after each search.")
    rate: float = Field(0.15, gt=0, description="Adam's first rate, in usual errors; falls to 0.")


def outlines_apart(clip: Clip, meshes: MeshSequence, configuration: MaskFitConfig) -> float:
    """How far the body's outline is from the masks', in pixels; nan where no mask shows it.

    Three quarters of the outline are nearer. Clothes push the whole outline outward, so a distance
    that all points share says nothing and is taken off.
    """
    frames = clip.frame_indices[_shown(clip)]
    outlines = _mask_outlines(clip, configuration)
    topology, focal = EdgeTopology.of(meshes.faces), _focal(clip.camera)
    off = [np.zeros(0)]
    for vertices, mask in zip(meshes.at(frames).vertices, outlines, strict=True):
        body = topology.outline(vertices, clip.camera)
        pairs = _pairs(body, mask, focal, configuration)
        apart = body.pixels[pairs.body] - mask.pixels[pairs.mask]
        off.append((apart * mask.normals[pairs.mask]).sum(-1))
    distances = np.concatenate(off)
    if not len(distances):
        return float("nan")
    return float(np.percentile(np.abs(distances - np.median(distances)), 75))


def expected_share(apart_px: float, configuration: MaskFitConfig) -> float:
    """How large errors are to be expected, in usual ones: 0 where the estimate fits already."""
    if np.isnan(apart_px):
        return 0.0
    ramp = configuration.apart_px - configuration.agreeing_px
    return float(np.clip((apart_px - configuration.agreeing_px) / ramp, 0.0, 1.0))


def fit_to_masks(
    clip: Clip,
    meshes: MeshSequence,
    expected: float,
    configuration: MaskFitConfig,
    progress: Progress,
) -> MeshSequence:
    """The meshes with their joints and place corrected towards the masks of the training frames.

    The correction is the likeliest one: each joint errs by a few degrees, smoothly in time, bones
    keep their lengths. Held-out frames, whose masks are not looked at, and frames between get the
    correction of the moment. Without any mask to fit the meshes come back as they were.

    Args:
        clip: of the camera trained on.
        meshes: world metres; holds every frame of the clip.
        expected: size of the errors, in usual ones, above 0.
    """
    frames = clip.frame_indices[_shown(clip)]
    if not len(frames):
        return meshes
    outlines = _mask_outlines(clip, configuration)
    skeleton = articulate(meshes.vertices, meshes.faces, configuration.parts, configuration.blend_m)
    rows = np.searchsorted(meshes.frame_indices, frames)
    topology = EdgeTopology.of(meshes.faces)
    correction = _no_correction(skeleton, meshes, clip, frames, expected, configuration)
    # Sums over several threads differ in their last bit from run to run.
    with torch_threads(1):
        _optimise(correction, rows, outlines, topology, clip.camera, configuration, progress)
        with torch.no_grad():
            vertices = correction.vertices(np.arange(len(meshes.vertices)))
    return replace(meshes, vertices=vertices)


def _shown(clip: Clip) -> NDArray[np.bool_]:
    """Training frames (T,) with a person in the mask."""
    return ~clip.held_out & clip.has_mask & clip.masks.any(axis=(1, 2))


def _mask_outlines(clip: Clip, configuration: MaskFitConfig) -> list[MaskOutline]:
    return [MaskOutline.of(mask, configuration.outline_points) for mask in clip.masks[_shown(clip)]]


def _no_correction(
    skeleton: Articulation,
    meshes: MeshSequence,
    clip: Clip,
    frames: NDArray[np.int32],
    expected: float,
    configuration: MaskFitConfig,
) -> JointCorrection:
    kept = clip.frame_indices[~clip.held_out]
    stride = float(np.median(np.diff(kept))) if len(kept) > 1 else 1.0
    rate = stride * clip.fps  # of the source's numbering
    mixing = smooth_mixing(meshes.frame_indices / rate, frames / rate, configuration.error_seconds)
    least, most = np.radians([configuration.stiff_error_deg, configuration.joint_error_deg])
    angles = np.clip(skeleton.bend, least, most)
    angles[0] = most
    return JointCorrection(
        skeleton,
        meshes.vertices,
        mixing,
        expected * angles,
        expected * configuration.root_error_m,
        configuration.clothes_m,
    )


def _focal(camera: Camera) -> float:
    return float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))


def _pairs(
    body: BodyOutline, mask: MaskOutline, focal: float, configuration: MaskFitConfig
) -> Matches:
    depth = float(np.median(body.depth)) if len(body.depth) else 1.0
    turn_px = configuration.turn_m * focal / depth
    return match_outlines(body, mask, turn_px, configuration.least_agreement)


@dataclass(frozen=True, eq=False)
class _Targets:
    """Matching points of all frames, padded; a weight of zero is padding."""

    weights: Tensor  # (T, M, P)
    places: Tensor  # (T, M, 3) world metres, before the correction
    pixels: Tensor  # (T, M, 2)
    normals: Tensor  # (T, M, 2)
    share: Tensor  # (T, M)


def _find_targets(
    correction: JointCorrection,
    rows: NDArray[np.int64],
    outlines: list[MaskOutline],
    topology: EdgeTopology,
    camera: Camera,
    configuration: MaskFitConfig,
) -> _Targets:
    with torch.no_grad():
        posed = correction.vertices(rows)
    focal = _focal(camera)
    found = []
    for vertices, mask in zip(posed, outlines, strict=True):
        body = topology.outline(vertices, camera)
        pairs = _pairs(body, mask, focal, configuration)
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
    correction: JointCorrection,
    rows: NDArray[np.int64],
    outlines: list[MaskOutline],
    topology: EdgeTopology,
    camera: Camera,
    configuration: MaskFitConfig,
    progress: Progress,
) -> None:
    optimiser = torch.optim.Adam(correction.unknowns(), configuration.rate, eps=_ADAM_EPSILON)
    steps = configuration.rounds * configuration.steps
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda step: 0.5 * (1.0 + np.cos(np.pi * step / steps))
    )
    for attempt in range(configuration.rounds):
        progress(attempt / configuration.rounds, "fitting the body to the masks")
        share = attempt / max(configuration.rounds - 1, 1)
        outlier_m = configuration.outlier_m ** (1.0 - share) * configuration.last_outlier_m**share
        targets = _find_targets(correction, rows, outlines, topology, camera, configuration)
        for _ in range(configuration.steps):
            optimiser.zero_grad()
            loss = correction.surprise() + _misfit(
                correction, rows, targets, camera, outlier_m, configuration
            )
            loss.backward()
            optimiser.step()
            schedule.step()


def _misfit(
    correction: JointCorrection,
    rows: NDArray[np.int64],
    targets: _Targets,
    camera: Camera,
    outlier_m: float,
    configuration: MaskFitConfig,
) -> Tensor:
    """Squared distances between the outlines over their usual square; far ones count less."""
    rotation, shift, intrinsics = (
        torch.from_numpy(np.asarray(part)).float() for part in (camera.R, camera.t, camera.K)
    )
    world = blend(targets.weights, correction.transforms(rows), targets.places)
    points = world @ rotation.T + shift
    depth = points[..., 2:].clamp_min(0.05)
    pixels = (points @ intrinsics.T)[..., :2] / depth
    focal = intrinsics.diagonal()[:2]
    off = ((pixels - targets.pixels) / focal * depth * targets.normals).sum(-1)
    off = off + correction.stand_off(targets.weights)
    squared = off * off
    robust = squared / (1.0 + squared / outlier_m**2)
    per_frame = (targets.share * robust).sum(-1)
    return (
        0.5 * configuration.independent_points / configuration.outline_error_m**2 * per_frame.sum()
    )
