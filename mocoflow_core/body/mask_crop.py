"""The part of an image around the person, at a chosen resolution, with the camera that sees it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.silhouette import cover
from mocoflow_core.geometry.camera import Camera

Array = NDArray[np.float64]
# Nothing is drawn nearer to the camera than this.
NEAR_M = 0.05
# In pixels of the crop: about what the area of a pixel averages over.
BLUR_PX = 0.4


@dataclass(frozen=True, eq=False)
class MaskCrop:
    """A square around the mask. Bodies in the camera's axes can be drawn into it.

    The part of the crop that lies beyond the image's border says nothing of the body.
    """

    coverage: NDArray[np.float32]  # (S, S) share of each pixel that the mask covers
    K: Array  # intrinsics of the crop, corner origin
    rows: slice  # of the crop that lie in the image
    columns: slice

    @classmethod
    def around(cls, mask: NDArray[np.bool_], camera: Camera, side_px: int, pad: float) -> MaskCrop:
        """A crop of ``side_px`` whose side is ``pad`` times the longer side of the mask's box."""
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        low = np.array([columns[0], rows[0]], np.float64)
        high = np.array([columns[-1], rows[-1]], np.float64) + 1
        scale = side_px / (pad * (high - low).max())
        corner = (low + high) / 2 - 0.5 * side_px / scale
        # From pixels of the image to pixels of the crop, both with the corner origin.
        to_crop = np.array([[scale, 0, -scale * corner[0]], [0, scale, -scale * corner[1]]])
        K = np.vstack([to_crop, [0, 0, 1]]) @ camera.K
        height, width = mask.shape
        return cls(
            _resampled(mask, to_crop, scale, side_px),
            K,
            _seen(to_crop[1, 2], scale * height, side_px),
            _seen(to_crop[0, 2], scale * width, side_px),
        )

    @property
    def side_px(self) -> int:
        return len(self.coverage)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Pixels (S, S) that lie in the image."""
        inside = np.zeros(self.coverage.shape, bool)
        inside[self.rows, self.columns] = True
        return inside

    def beyond(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """A mask (S, S) that goes on beyond the image as it is at the border: no edge is there."""
        height, width = mask.shape
        above_and_below = (self.rows.start, height - self.rows.stop)
        beside = (self.columns.start, width - self.columns.stop)
        return np.pad(mask[self.rows, self.columns], (above_and_below, beside), mode="edge")

    @property
    def focal_px(self) -> float:
        return float(np.sqrt(self.K[0, 0] * self.K[1, 1]))

    def draw(self, points_camera: Array, faces: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Pixels (S, S) covered by a body (V, 3) in the camera's axes, metres."""
        drawn = faces[(points_camera[:, 2] > NEAR_M)[faces].all(axis=1)]
        return cover(self.project(points_camera), drawn, self.side_px, self.side_px)

    def project(self, points_camera: Array) -> Array:
        """Pixels of the crop (..., 2) of points in the camera's axes."""
        projected = points_camera @ self.K.T
        return projected[..., :2] / np.maximum(projected[..., 2:], NEAR_M)


def _seen(start: float, length: float, side_px: int) -> slice:
    """The pixels of the crop that lie wholly between two borders of the image."""
    first = min(max(int(np.ceil(start)), 0), side_px - 1)
    return slice(first, min(max(int(np.floor(start + length)), first + 1), side_px))


def _resampled(
    mask: NDArray[np.bool_], to_crop: Array, scale: float, side_px: int
) -> NDArray[np.float32]:
    """Coverage of the crop's pixels. Shrinking blurs first, so that none of the mask is lost."""
    image = mask.astype(np.float32)
    if scale < 1:
        image = cv2.GaussianBlur(image, (0, 0), BLUR_PX / scale).astype(np.float32)
    # cv2 has pixel centres at integers.
    half = np.array([0.5, 0.5])
    shifted = to_crop.copy()
    shifted[:, 2] += to_crop[:, :2] @ half - half
    crop = cv2.warpAffine(image, shifted, (side_px, side_px), flags=cv2.INTER_LINEAR)
    return crop.astype(np.float32, copy=False)


def facing(points_camera: Array, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """The faces that the camera sees from outside: they cover what a closed body covers."""
    corners = points_camera[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return faces[(normals * corners[:, 0]).sum(axis=1) < 0]
