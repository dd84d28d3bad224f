"""From a picture as stored to the working size: lens distortion removed, area-averaged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

# Pixel centres of the corner origin.
_HALF_PIXEL = 0.5
# Radii at which a lens model is looked at.
_RADII = 512


@dataclass(frozen=True, eq=False)
class WorkingView:
    """Brings pictures of ``source`` to the undistorted pinhole ``camera``.

    Distortion is removed at full size first, then the picture shrinks by averaging the covered
    area, which is exact for the corner origin of ``K``.
    """

    source: Camera
    camera: Camera

    @classmethod
    def of(cls, source: Camera, max_side: int) -> WorkingView:
        """The view whose longer side has at most ``max_side`` pixels; never enlarged.

        Raises InputError for a lens model that shows a place of the image twice.
        """
        _require_no_fold(source)
        scale = min(1.0, max_side / max(source.width, source.height))
        width, height = round(source.width * scale), round(source.height * scale)
        return cls(source, source.undistorted().resized(max(width, 1), max(height, 1)))

    def image(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A picture (H, W, 3) or a mask (H, W) of 0 to 255 at the working size."""
        if self._maps is not None:
            bent = cv2.remap(picture, *self._maps, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
            picture = bent.astype(np.uint8, copy=False)
        if picture.shape[:2] == (self.camera.height, self.camera.width):
            return np.ascontiguousarray(picture)
        size = (self.camera.width, self.camera.height)
        shrunk = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        return shrunk.astype(np.uint8, copy=False)

    def mask(self, picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """A mask (H, W) of 0 to 255 at the working size: true where most of the area is."""
        binary = np.where(picture > 127, np.uint8(255), np.uint8(0))
        return self.image(binary) > 127

    @cached_property
    def _maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """For each undistorted pixel its place in the stored picture; none without distortion."""
        if self.source.is_pinhole:
            return None
        columns, rows = np.meshgrid(np.arange(self.source.width), np.arange(self.source.height))
        pixels = np.stack([columns, rows], axis=-1).astype(np.float64) + _HALF_PIXEL
        # cv2.remap has pixel centres at integers.
        places = (distort(pixels, self.source) - _HALF_PIXEL).astype(np.float32)
        return places[..., 0].copy(), places[..., 1].copy()


def _require_no_fold(camera: Camera) -> None:
    """A radius of the ideal picture must never move inwards while it grows."""
    corners = np.array([[x, y, 1.0] for x in (0, camera.width) for y in (0, camera.height)])
    rays = corners @ np.linalg.inv(camera.K).T
    r2 = np.linspace(0, 1, _RADII) ** 2 * (rays[:, :2] ** 2).sum(axis=-1).max()
    k1, k2, _, _, k3 = camera.distortion
    growth = 1 + r2 * (3 * k1 + r2 * (5 * k2 + r2 * 7 * k3))
    if (growth <= 0).any():
        share = float(np.sqrt(r2[growth <= 0][0] / r2[-1]))
        raise InputError(
            f"the distortion of {camera.name} must be one to one over its image",
            f"one that folds back at {100 * share:.0f} % of the way to the corner",
            "Calibrate with fewer coefficients, or undistort the frames and give zeros.",
        )


def distort(pixels: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Where the lens moves ideal pinhole pixels (..., 2), corner origin.

    OpenCV's model ``k1, k2, p1, p2, k3``; the skew of ``K`` is kept.
    """
    k1, k2, p1, p2, k3 = camera.distortion
    homogeneous = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
    rays = homogeneous @ np.linalg.inv(camera.K).T
    x, y = rays[..., 0], rays[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    bent = np.stack([bent_x, bent_y, np.ones_like(x)], axis=-1)
    return (bent @ camera.K.T)[..., :2]
