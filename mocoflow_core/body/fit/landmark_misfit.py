"""How far the body's landmarks are from those that were seen, in the picture and in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.body.fit.fittable_body import FittableBody
from mocoflow_core.body.fit.least_squares import System
from mocoflow_core.body.fit.posed_body import BodyPose, Mixtures, PosedBody
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.configuration import ConfigurationPart

Array = NDArray[np.float64]

# Nearer points have no projection.
_NEAR_M = 0.1


class LandmarkConfig(ConfigurationPart):
    """How well detectors see."""

    picture_error_m: float = Field(0.015, gt=0, description="Usual error across the sight.")
    space_error_m: float = Field(0.07, gt=0, description="Usual error of landmarks in space.")
    outlier: float = Field(3.0, gt=0, description="Usual errors beyond which one counts less.")


@dataclass(frozen=True, eq=False)
class PictureMisfit:
    """Reprojection; pixels are worth metres at the depth the body was first guessed at."""

    body: FittableBody
    regressor: Array  # (21, V)
    sightings: Sightings
    K: Array  # (3, 3)
    scale: Array  # (T,) metres for each pixel
    error_m: float
    outlier: float

    def __call__(self, pose: BodyPose) -> System:
        points = Mixtures.of(self.body, self.regressor, pose.shape)
        places, by_frame, by_shape = PosedBody.of(self.body, pose).derivatives(points)
        pixels, slopes = project(places, self.K)
        trust = np.sqrt(self.sightings.confidence) * self.scale[:, None] / self.error_m
        off = trust[..., None] * (pixels - self.sightings.places)
        weight, cost = held_down((off**2).sum(-1), self.outlier)
        slopes = (weight * trust)[..., None, None] * slopes
        return _stacked(cost, weight[..., None] * off, slopes @ by_frame, slopes @ by_shape, pose)


@dataclass(frozen=True, eq=False)
class SpaceMisfit:
    """Landmarks in space against the body's, both from their own middle, in one common scale."""

    body: FittableBody
    regressor: Array
    sightings: Sightings
    error_m: float
    outlier: float

    def __call__(self, pose: BodyPose) -> System:
        assert self.sightings.world is not None
        points = Mixtures.of(self.body, self.regressor, pose.shape)
        derivatives = PosedBody.of(self.body, pose).derivatives(points)
        trust = self.sightings.confidence
        share = trust / np.maximum(trust.sum(1, keepdims=True), 1e-9)
        places, by_frame, by_shape = (_centred(part, share) for part in derivatives)
        seen = _centred(self.sightings.world, share)
        alike = trust[..., None] * seen
        size = float((alike * places).sum()) / max(float((alike * seen).sum()), 1e-9)
        root = np.sqrt(trust)[..., None] / self.error_m
        off = root * (places - size * seen)
        weight, cost = held_down((off**2).sum(-1), self.outlier)
        slope = (weight[..., None] * root)[..., None]
        return _stacked(cost, weight[..., None] * off, slope * by_frame, slope * by_shape, pose)


def project(places: Array, K: Array) -> tuple[Array, Array]:
    """Pixels (..., 2) of points in the camera's axes (..., 3), and their derivatives (..., 2, 3)."""
    depth = np.maximum(places[..., 2:], _NEAR_M)
    pixels = (places @ K.T)[..., :2] / depth
    slopes = (K[:2] - pixels[..., None] * K[2]) / depth[..., None]
    return pixels, slopes


def held_down(squared: Array, outlier: float) -> tuple[Array, float]:
    """Square roots of the weights that hold down outliers, and the cost (Cauchy's)."""
    ratio = squared / outlier**2
    return 1 / np.sqrt(1 + ratio), 0.5 * outlier**2 * float(np.log1p(ratio).sum())


def _centred(values: Array, share: Array) -> Array:
    """(T, N, ...) less their weighted mean over N."""
    weights = share.reshape(*share.shape, *[1] * (values.ndim - 2))
    return values - (weights * values).sum(1, keepdims=True)


def _stacked(cost: float, off: Array, by_frame: Array, by_shape: Array, pose: BodyPose) -> System:
    frames = len(off)
    clothes = np.zeros((*by_shape.shape[:-1], len(pose.clothes)))
    shared = np.concatenate([by_shape, clothes], axis=-1)
    return System.of(
        cost,
        off.reshape(frames, -1),
        by_frame.reshape(frames, -1, by_frame.shape[-1]),
        shared.reshape(frames, -1, shared.shape[-1]),
    )
