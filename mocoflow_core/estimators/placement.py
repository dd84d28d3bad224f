"""Translations of a body for a given camera, from what a tool knew of its own.

Every function keeps the pixel and the size of one point of each body, its anchor: what a single
picture fixes. With the principal point in the middle and the anchor at the origin this is the
usual closed form ``(tx, ty, 2 f / (s b))``.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera

Array = NDArray[np.float64]

WORTH_SAYING = 0.01


@dataclass(frozen=True, eq=False)
class ToolCamera:
    """The pinhole that a tool assumed: square pixels, corner origin."""

    focal_px: float | Array  # or (T,)
    centre: Array  # (2,) or (T, 2) pixels

    @classmethod
    def of_diagonal(cls, camera: Camera, focal_px: float | None) -> ToolCamera:
        """Focal length as long as the image's diagonal, unless it is given."""
        return cls(focal_px or float(np.hypot(camera.width, camera.height)), middle(camera))


def middle(camera: Camera) -> Array:
    """The middle of a camera's image, (2,) pixels."""
    return np.array([camera.width, camera.height]) / 2


def weak_translations(scale_px: Array, origin_px: Array, anchors: Array, camera: Camera) -> Array:
    """Translations (T, 3) metres that show bodies as a weak perspective camera does.

    Args:
        scale_px: (T,) pixels per metre.
        origin_px: (T, 2) pixel of each body's origin.
        anchors: (T, 3) a point of each body, metres from its origin; its middle is best.
        camera: the train camera.
    """
    pixels = origin_px + scale_px[:, None] * anchors[:, :2]
    return _points(pixels, _focal_px(camera) / scale_px, camera) - anchors


def box_placement(cam: Array, centre: Array, side: Array) -> tuple[Array, Array]:
    """Pixels per metre (T,) and pixel of the origin (T, 2) of ``s, tx, ty`` in a square box.

    ``u = cx + b / 2 · s (X + tx)``, the form of HMR and its descendants.
    """
    scale_px = side / 2 * cam[:, 0]
    return scale_px, centre + scale_px[:, None] * cam[:, 1:]


def refocused(translations: Array, anchors: Array, made_for: ToolCamera, camera: Camera) -> Array:
    """Translations (T, 3) for the train camera, from those for another focal length and centre.

    Depths of the anchors grow with the focal length; x and y stay where the principal points agree.
    """
    points = translations + anchors
    focal_px = np.broadcast_to(made_for.focal_px, len(points))
    pixels = made_for.centre + focal_px[:, None] * points[:, :2] / points[:, 2:]
    return _points(pixels, points[:, 2] * _focal_px(camera) / focal_px, camera) - anchors


def where_known(translations: Array) -> Array:
    """Translations (T, 3) with nan where the tool's numbers put nobody before the camera."""
    known = np.isfinite(translations).all(axis=1) & (translations[:, 2] > 0)
    return np.where(known[:, None], translations, np.nan)


def placed(
    tool: str, vertices: NDArray[np.float32], made_for: ToolCamera, camera: Camera
) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """Bodies (T, V, 3) that a tool placed for its camera, placed for the train camera.

    With a remark where distances change by more than a per cent.
    """
    anchors = middles(vertices)
    shifts = refocused(np.zeros_like(anchors), anchors, made_for, camera)
    made_px = float(np.median(made_for.focal_px))
    ratio = _focal_px(camera) / made_px
    remarks: tuple[str, ...] = ()
    if abs(ratio - 1) > WORTH_SAYING:
        remarks = (
            f"{tool} took the focal length for {made_px:.0f} px where the camera's is "
            f"{_focal_px(camera):.0f} px: distances are scaled by {ratio:.3g}",
        )
    return vertices + shifts[:, None].astype(np.float32), remarks


def middles(vertices: NDArray[np.floating]) -> Array:
    """The middle (T, 3) of each body (T, V, 3), its anchor."""
    return vertices.mean(axis=1, dtype=np.float64)


def _points(pixels: Array, depths: Array, camera: Camera) -> Array:
    """Points (T, 3) in the camera's axes, seen at pixels (T, 2) of the picture as stored."""
    if not camera.is_pinhole:
        ideal = cv2.undistortPoints(pixels[:, None], camera.K, camera.distortion, P=camera.K)
        pixels = np.asarray(ideal, np.float64).reshape(-1, 2)
    rays = np.linalg.solve(camera.K, np.column_stack([pixels, np.ones(len(pixels))]).T).T
    return depths[:, None] * rays


def _focal_px(camera: Camera) -> float:
    """One focal length for cameras whose pixels are not quite square."""
    return float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
