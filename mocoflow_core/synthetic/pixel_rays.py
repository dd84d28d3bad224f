"""Rays through the samples of a camera's pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera


@dataclass(frozen=True)
class PixelBox:
    """A rectangle of whole pixels, ends excluded."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.bottom - self.top, self.right - self.left

    @classmethod
    def whole(cls, camera: Camera) -> PixelBox:
        return cls(0, 0, camera.width, camera.height)

    @classmethod
    def around(cls, points_world: NDArray[np.floating], camera: Camera) -> PixelBox:
        """The pixels that points (N, 3) in front of the camera project to, inside its image."""
        pixels = camera.project(np.asarray(points_world, np.float64))
        size = [camera.width, camera.height]
        low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0)) + 1, low, size).astype(int)
        return cls(int(low[0]), int(low[1]), int(high[0]), int(high[1]))

    def rays(self, camera: Camera, supersampling: int) -> NDArray[np.float32]:
        """Directions in the world, not normalised (depth one), of the samples of each pixel.

        (rows x columns x samples, 3); the samples of one pixel lie side by side.
        """
        steps = (np.arange(supersampling) + 0.5) / supersampling
        x = (np.arange(self.left, self.right)[:, None] + steps)[None, :, None, :]
        y = (np.arange(self.top, self.bottom)[:, None] + steps)[:, None, :, None]
        pixels = np.ones((*self.shape, supersampling, supersampling, 3))
        pixels[..., 0], pixels[..., 1] = x, y
        to_world = np.linalg.inv(camera.K).T @ camera.R
        return (pixels.reshape(-1, 3) @ to_world).astype(np.float32)
