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
class LandmarkMisfit:
    """Reprojection and, where landmarks have a place in space, the distance there.

    Pixels are worth metres at the depth the body was first guessed at. In space both bodies are
    taken from their own middle, in one common scale.
    """

    body: FittableBody
    points: Mixtures  # of the mean shape
    sightings: Sightings
    K: Array  # (3, 3)
    metres: Array  # (T,) for each pixel
    configuration: LandmarkConfig
    picture_error_m: float

    def __call__(self, pose: BodyPose) -> System:
        posed = PosedBody.of(self.body, pose)
        places, by_frame, by_shape = posed.derivatives(self.points.shaped(pose.shape))
        clothes = np.zeros((*by_shape.shape[:-1], len(pose.clothes)))
        by_shared = np.concatenate([by_shape, clothes], axis=-1)
        total = self._picture(places, by_frame, by_shared)
        if self.sightings.world is None:
            return total
        return total + self._space(self.sightings.world, places, by_frame, by_shared)

    def _picture(self, places: Array, by_frame: Array, by_shared: Array) -> System:
        outlier = self.configuration.outlier
        pixels, slopes = project(places, self.K)
        trust = np.sqrt(self.sightings.confidence) * self.metres[:, None] / self.picture_error_m
        off = trust[..., None] * (pixels - self.sightings.places)
        weight, cost = held_down((off**2).sum(-1), outlier)
        slopes = (weight * trust)[..., None, None] * slopes
        return _stacked(cost, weight[..., None] * off, slopes @ by_frame, slopes @ by_shared)

    def _space(self, seen: Array, *derivatives: Array) -> System:
        trust = self.sightings.confidence
        share = trust / np.maximum(trust.sum(1, keepdims=True), 1e-9)
        places, by_frame, by_shared = (_centred(part, share) for part in derivatives)
        seen = _centred(seen, share)
        # The body is scaled to what was seen, not the other way: a smaller body is no better.
        alike = trust[..., None] * places
        size = float((alike * seen).sum()) / max(float((alike * places).sum()), 1e-9)
        root = np.sqrt(trust)[..., None] / self.configuration.space_error_m
        off = root * (size * places - seen)
        weight, cost = held_down((off**2).sum(-1), self.configuration.outlier)
        slope = size * (weight[..., None] * root)[..., None]
        return _stacked(cost, weight[..., None] * off, slope * by_frame, slope * by_shared)


def project(places: Array, K: Array) -> tuple[Array, Array]:
    """Pixels (..., 2) of points (..., 3) in the camera's axes, and derivatives (..., 2, 3)."""
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


def _stacked(cost: float, off: Array, by_frame: Array, by_shared: Array) -> System:
    frames = len(off)
    return System.of(
        cost,
        off.reshape(frames, -1),
        by_frame.reshape(frames, -1, by_frame.shape[-1]),
        by_shared.reshape(frames, -1, by_shared.shape[-1]),
    )
