"""Which pixels can show the person, and between which depths."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.geometry.camera import Camera

_CLOSEST_M = 0.05  # nodes nearer to the camera's plane than this cannot be projected


@dataclass(frozen=True, eq=False)
class VisiblePixels:
    """Pixels that can show the person, with the depth range to be looked at behind each."""

    pixels: Tensor  # (N,) flat indices, ascending
    nearest: Tensor  # (N,) metres along the viewing axis
    farthest: Tensor  # (N,)

    def select(self, keep: Tensor) -> VisiblePixels:
        """Only the pixels where ``keep`` (N,) is true."""
        return VisiblePixels(self.pixels[keep], self.nearest[keep], self.farthest[keep])


def shell_pixels(camera: Camera, body: BodyMotion, row: int, shell_width_m: float) -> VisiblePixels:
    """Pixels that rays through the shell of one moment can belong to.

    Each lattice node of the shell paints a disc that covers its cell. Painted from far to near,
    the discs leave the nearest depth, from near to far the farthest.
    """
    points, spacing = body.shell_nodes(row, shell_width_m)
    depth = camera.to_camera(points)[:, 2]
    visible = depth > _CLOSEST_M
    at, depth = camera.project(points[visible]), depth[visible]
    cell_radius = 0.5 * np.sqrt(3.0) * spacing
    focal = max(camera.K[0, 0], camera.K[1, 1])
    radius = np.ceil(cell_radius * focal / np.maximum(depth - cell_radius, _CLOSEST_M))
    order = np.argsort(depth)
    farthest = _paint(camera, at[order], radius[order], depth[order])
    nearest = _paint(camera, at[order[::-1]], radius[order[::-1]], depth[order[::-1]])
    pixels = np.flatnonzero(farthest)
    return VisiblePixels(
        torch.from_numpy(pixels),
        torch.from_numpy(nearest.ravel()[pixels] - cell_radius).float(),
        torch.from_numpy(farthest.ravel()[pixels] + cell_radius).float(),
    )


def _paint(camera: Camera, at: NDArray, radius: NDArray, depth: NDArray) -> NDArray[np.float32]:
    image = np.zeros((camera.height, camera.width), np.float32)
    near_image = (np.abs(at) < 4 * (camera.width + camera.height)).all(axis=1)
    # Plain numbers: taking them out of arrays one by one costs more than the painting.
    discs = zip(
        at[near_image].astype(int).tolist(),
        radius[near_image].astype(int).tolist(),
        depth[near_image].tolist(),
        strict=True,
    )
    for centre, r, value in discs:
        cv2.circle(image, centre, r, value, -1)
    return image
