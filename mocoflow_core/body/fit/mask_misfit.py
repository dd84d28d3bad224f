"""How far the body's outline lies from the masks' outlines, clothes apart."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.body.fit.fittable_body import FittableBody
from mocoflow_core.body.fit.landmark_misfit import project
from mocoflow_core.body.fit.least_squares import System
from mocoflow_core.body.fit.posed_body import UNKNOWNS, BodyPose, PosedBody, SkinPoints
from mocoflow_core.body.outline import EdgeTopology, MaskOutline, match_outlines
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.geometry.camera import Camera

Array = NDArray[np.float64]
Masks = NDArray[np.bool_]

# Frames are taken in portions that bound the memory of their derivatives.
_PORTION = 16


class MaskConfig(ConfigurationPart):
    """What is usual of masks, and how their outlines are matched."""

    person_px: float = Field(200.0, gt=0, description="Masks are shrunk to persons this high.")
    outline_error_m: float = Field(0.015, gt=0, description="Usual distance of right outlines.")
    independent_points: int = Field(
        40, ge=1, description="Parts of one frame's outline that err on their own."
    )
    outline_points: int = Field(100, ge=8, description="Points taken on each outline.")
    turn_m: float = Field(0.05, gt=0, description="Distance that a turn of 60 degrees is worth.")
    least_agreement: float = Field(0.3, ge=-1, le=1, description="Cosine of matching outlines.")
    outlier_m: tuple[float, float] = Field(
        (0.08, 0.03), description="Farther outlines count less: at the first look, at the last."
    )


@dataclass(frozen=True, eq=False)
class MaskOutlines:
    """The masks' outlines at a working size, and the camera of that size."""

    body: FittableBody
    camera: Camera  # at the origin: the body lives in the camera's axes
    masks: Masks  # (T, h, w)
    outlines: list[MaskOutline]
    configuration: MaskConfig

    @classmethod
    def of(
        cls, body: FittableBody, masks: Masks, camera: Camera, configuration: MaskConfig
    ) -> MaskOutlines:
        """Masks (T, H, W); empty ones say nothing."""
        width, height = _working_size(masks, configuration.person_px)
        small = camera.resized(width, height)
        own = replace(small, R=np.eye(3), t=np.zeros(3))
        small_masks = np.stack([_resized(mask, width, height) for mask in masks])
        outlines = [MaskOutline.of(mask, configuration.outline_points) for mask in small_masks]
        return cls(body, own, small_masks, outlines, configuration)

    def overlaps(self, pose: BodyPose) -> Array:
        """Intersection over union (T,) with the masks; NaN where a mask is empty."""
        drawn = silhouettes(PosedBody.of(self.body, pose).vertices(), self.body.faces, self.camera)
        return np.where(self.masks.any(axis=(1, 2)), overlap(drawn, self.masks), np.nan)

    def look(self, pose: BodyPose, outlier_m: float) -> MaskMisfit:
        """The points that belong together as the body stands now."""
        configuration, most = self.configuration, 2 * self.configuration.outline_points
        posed = PosedBody.of(self.body, pose)
        topology = EdgeTopology.of(self.body.faces)
        frames = len(self.outlines)
        edges = np.zeros((frames, most, 2), np.int64)
        pixels, normals = np.zeros((frames, most, 2)), np.zeros((frames, most, 2))
        scale, trust = np.zeros((frames, most)), np.zeros((frames, most))
        focal = float(np.sqrt(self.camera.K[0, 0] * self.camera.K[1, 1]))
        for row, (vertices, mask) in enumerate(zip(posed.vertices(), self.outlines, strict=True)):
            if not len(mask.pixels):
                continue
            body = topology.outline(vertices, self.camera)
            depth = float(np.median(body.depth)) if len(body.depth) else 1.0
            turn_px = configuration.turn_m * focal / depth
            pairs = match_outlines(body, mask, turn_px, configuration.least_agreement)
            kept = np.linspace(0, len(pairs.body) - 1, min(most, len(pairs.body))).astype(np.int64)
            ours, theirs = pairs.body[kept], pairs.mask[kept]
            count = len(kept)
            edges[row, :count] = body.edges[ours]
            pixels[row, :count], normals[row, :count] = mask.pixels[theirs], mask.normals[theirs]
            scale[row, :count] = body.depth[ours] / focal
            trust[row, :count] = configuration.independent_points / max(count, 1)
        return MaskMisfit(
            self.body,
            self.camera.K,
            edges,
            pixels,
            normals,
            scale,
            trust,
            configuration.outline_error_m,
            outlier_m,
        )


@dataclass(frozen=True, eq=False)
class MaskMisfit:
    """Distances along the normals between points that belong together, in usual errors."""

    body: FittableBody
    K: Array
    edges: NDArray[np.int64]  # (T, N, 2)
    pixels: Array  # (T, N, 2) on the mask's outline
    normals: Array  # (T, N, 2) outward
    scale: Array  # (T, N) metres for each pixel
    trust: Array  # (T, N) zero is padding
    error_m: float
    outlier_m: float

    def __call__(self, pose: BodyPose) -> System:
        frames = len(self.edges)
        total = System.nothing(frames, UNKNOWNS, len(pose.shape) + len(pose.clothes))
        for start in range(0, frames, _PORTION):
            rows = slice(start, start + _PORTION)
            part = self._portion(pose, rows)
            for whole, piece in (
                (total.gradient, part.gradient),
                (total.blocks, part.blocks),
                (total.border, part.border),
            ):
                whole[rows] = piece
            total = replace(
                total,
                cost=total.cost + part.cost,
                shared_gradient=total.shared_gradient + part.shared_gradient,
                corner=total.corner + part.corner,
            )
        return total

    def _portion(self, pose: BodyPose, rows: slice) -> System:
        points = SkinPoints.middles(self.body, self.edges[rows], pose.shape)
        posed = PosedBody.of(self.body, pose.frames(rows))
        places, by_frame, by_shape = posed.derivatives(points)
        pixels, slopes = project(places, self.K)
        metres = (self.scale[rows][..., None] * self.normals[rows])[..., None, :]
        clothed = points.mass @ pose.clothes
        off = (metres[..., 0, :] * (pixels - self.pixels[rows])).sum(-1) + clothed
        ratio = off**2 / self.outlier_m**2
        trust = self.trust[rows] / self.error_m**2
        cost = 0.5 * self.outlier_m**2 * float((trust * np.log1p(ratio)).sum())
        weight = np.sqrt(trust / (1 + ratio))
        towards = metres @ slopes
        along_frame = (towards @ by_frame)[..., 0, :]
        shared = np.concatenate([(towards @ by_shape)[..., 0, :], points.mass], axis=-1)
        lifted = weight[..., None]
        return System.of(cost, weight * off, lifted * along_frame, lifted * shared)


def _working_size(masks: Masks, person_px: float) -> tuple[int, int]:
    """Width and height at which the person is at most so high."""
    height, width = masks.shape[1:]
    tall = [np.flatnonzero(mask.any(1)) for mask in masks if mask.any()]
    usual = float(np.median([rows[-1] - rows[0] + 1 for rows in tall])) if tall else 1.0
    share = min(1.0, person_px / usual)
    return max(2, round(share * width)), max(2, round(share * height))


def _resized(mask: NDArray[np.bool_], width: int, height: int) -> NDArray[np.bool_]:
    if mask.shape == (height, width):
        return mask
    covered = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(covered > 0.5)
