"""Cameras that walk around a point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mocoflow_core.geometry.camera import Camera


def moved_around(camera: Camera, axis_angle: ArrayLike, pivot: ArrayLike) -> Camera:
    """The camera carried by a rotation about a point; the point keeps its place in the image.

    Args:
        axis_angle: (3,) world axis times radians.
        pivot: (3,) world metres.
    """
    rotation = Rotation.from_rotvec(np.asarray(axis_angle, np.float64)).as_matrix()
    point = np.asarray(pivot, np.float64)
    return replace(
        camera,
        R=camera.R @ rotation.T,
        t=camera.R @ (point - rotation.T @ point) + camera.t,
    )
