"""How far a corrected body's outline lies from the masks' outlines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field, model_validator
from torch import Tensor

from mocoflow_core.body.joint_correction import JointCorrection, blend
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

Array = NDArray[np.float64]


class MaskMisfitConfig(ConfigurationPart):
    """What is usual of masks, and how their outlines are matched."""

    outline_error_m: float = Field(0.02, gt=0, description="Usual distance of right outlines.")
    agreeing_px: float = Field(
        0.5, ge=0, description="Outlines that agree so well, in three quarters of their points."
    )
    apart_px: float = Field(
        1.5, gt=0, description="Outlines so far apart show errors of the usual size."
    )
    independent_points: int = Field(
        60, ge=1, description="Parts of one frame's outline that err on their own."
    )
    outline_points: int = Field(240, ge=8, description="Points taken on each mask's outline.")
    turn_m: float = Field(0.05, gt=0, description="Distance that a turn of 60 degrees is worth.")
    least_agreement: float = Field(0.3, ge=-1, le=1, description="Cosine of matching outlines.")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.agreeing_px >= self.apart_px:
            raise ValueError("agreeing_px must be below apart_px")
        return self


@dataclass(frozen=True, eq=False)
class _Targets:
    """Matching points of all frames, padded; a weight of zero is padding."""

    weights: Tensor  # (T, M, P)
    places: Tensor  # (T, M, 3) world metres, before the correction
    depth: Tensor  # (T, M, 1) of these, metres
    pixels: Tensor  # (T, M, 2)
    normals: Tensor  # (T, M, 2)
    share: Tensor  # (T, M)


class MaskMisfit:
    """Squared distances between outlines over their usual square; far ones count less."""

    def __init__(
        self,
        clip: Clip,
        looked_at: NDArray[np.int64],
        rows: NDArray[np.int64],
        faces: NDArray[np.int32],
        configuration: MaskMisfitConfig,
    ) -> None:
        """Args: ``looked_at`` (T,) rows of the clip, ``rows`` (T,) the same frames' meshes."""
        self._camera = clip.camera
        self._rows = rows
        self._topology = EdgeTopology.of(faces)
        self._masks = [
            MaskOutline.of(mask, configuration.outline_points) for mask in clip.masks[looked_at]
        ]
        self._configuration = configuration

    def apart_px(self, vertices: NDArray[np.float32], parts: NDArray[np.int64]) -> float:
        """How far the body's outline is from the masks'; nan where no mask shows it.

        Three quarters of the outline are nearer. Clothes push the outline of a part outward, so a
        distance that all points of a part share, in all frames, says nothing and is taken off.

        Args:
            vertices: (T, V, 3) the estimate at the frames looked at.
            parts: (V,) number of each vertex's part.
        """
        off, part = [np.zeros(0)], [np.zeros(0, np.int64)]
        for posed, mask in zip(vertices, self._masks, strict=True):
            body = self._topology.outline(posed, self._camera)
            pairs = self._pairs(body, mask)
            apart = body.pixels[pairs.body] - mask.pixels[pairs.mask]
            off.append((apart * mask.normals[pairs.mask]).sum(-1))
            part.append(parts[body.edges[pairs.body][:, 0]])
        distances, part_of = np.concatenate(off), np.concatenate(part)
        if not len(distances):
            return float("nan")
        for label in np.unique(part_of):
            distances[part_of == label] -= np.median(distances[part_of == label])
        return float(np.percentile(np.abs(distances), 75))

    def look(self, correction: JointCorrection) -> _Targets:
        """The points that belong together as the body stands now."""
        with torch.no_grad():
            posed = correction.vertices(self._rows)
        found = []
        for vertices, mask in zip(posed, self._masks, strict=True):
            body = self._topology.outline(vertices, self._camera)
            pairs = self._pairs(body, mask)
            found.append(
                (body.edges[pairs.body], mask.pixels[pairs.mask], mask.normals[pairs.mask])
            )
        most = max(1, max(len(edges) for edges, _, _ in found))
        edges = np.zeros((len(self._rows), most, 2), np.int64)
        targets = np.zeros((len(self._rows), most, 5), np.float32)
        for row, (pairs_edges, pixels, normals) in enumerate(found):
            count = len(pairs_edges)
            edges[row, :count] = pairs_edges
            targets[row, :count] = np.concatenate(
                [pixels, normals, np.full((count, 1), 1.0 / max(count, 1))], axis=1
            )
        pixels, normals, share = torch.from_numpy(targets).split((2, 2, 1), -1)
        weights, places = correction.gather(self._rows, edges)
        _, depth = project(self._camera, places)
        return _Targets(weights, places, depth, pixels, normals, share[..., 0])

    def __call__(self, correction: JointCorrection, targets: _Targets, outlier_m: float) -> Tensor:
        """Minus the logarithm of how likely such distances are; beyond ``outlier_m`` saturated."""
        configuration = self._configuration
        world = blend(targets.weights, correction.transforms(self._rows), targets.places)
        pixels, depth = project(self._camera, world)
        focal = torch.from_numpy(np.diagonal(self._camera.K)[:2].copy()).float()
        # Lengths where the estimate stands: the same picture must cost the same near and far, or
        # small and near would seem likelier.
        off = ((pixels - targets.pixels) / focal * targets.depth * targets.normals).sum(-1)
        nearer = (targets.depth / depth)[..., 0]
        off = off + nearer * correction.stand_off(targets.weights)
        squared = off * off
        robust = squared / (1.0 + squared / outlier_m**2)
        usual = configuration.independent_points / configuration.outline_error_m**2
        return 0.5 * usual * (targets.share * robust).sum()

    def _pairs(self, body: BodyOutline, mask: MaskOutline) -> Matches:
        focal = float(np.sqrt(self._camera.K[0, 0] * self._camera.K[1, 1]))
        depth = float(np.median(body.depth)) if len(body.depth) else 1.0
        turn_px = self._configuration.turn_m * focal / depth
        return match_outlines(body, mask, turn_px, self._configuration.least_agreement)


def expected_share(apart_px: float, configuration: MaskMisfitConfig) -> float:
    """How large errors are to be expected, in usual ones: 0 where the estimate fits already."""
    if np.isnan(apart_px):
        return 0.0
    ramp = configuration.apart_px - configuration.agreeing_px
    return float(np.clip((apart_px - configuration.agreeing_px) / ramp, 0.0, 1.0))


def project(camera: Camera, world: Tensor) -> tuple[Tensor, Tensor]:
    """Pixels (..., 2) of world points (..., 3), differentiably, and their depth (..., 1)."""
    rotation, shift, intrinsics = (
        torch.from_numpy(np.asarray(part)).float() for part in (camera.R, camera.t, camera.K)
    )
    points = world @ rotation.T + shift
    depth = points[..., 2:].clamp_min(0.05)
    return (points @ intrinsics.T)[..., :2] / depth, depth


def between(ends: tuple[float, float], share: float) -> float:
    """From the first of two positive values to the second by equal ratios, share in [0, 1]."""
    first, last = ends
    return float(first ** (1.0 - share) * last**share)
