"""Cameras on a ring around the person, all looking at it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.synthetic.configuration import RecordingConfig

_TARGET = np.array([0.0, 0.0, 0.92])  # About the middle of a standing person, metres.
_HEIGHT, _HEIGHT_SPREAD = 1.25, 0.45  # Of the cameras above the floor, metres.
_FILLED = 0.94  # Share of the image that the person's largest extent takes.


def camera_ring(configuration: RecordingConfig, vertices: NDArray[np.float64]) -> list[Camera]:
    """Cameras whose common focal length just holds the person, vertices (T, V, 3), at all times.

    ``cam00`` stands in front (at -y); the others follow anticlockwise, at their own heights.
    """
    cameras = [_camera(index, configuration) for index in range(configuration.cameras)]
    focal = min(_largest_focal(camera, vertices) for camera in cameras)
    return [replace(camera, K=_intrinsics(camera, focal)) for camera in cameras]


def look_at(centre: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation world -> camera (3, 3) of an upright camera, OpenCV axes, world up +z."""
    forward = target - centre
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])


def _camera(index: int, configuration: RecordingConfig) -> Camera:
    angle = -np.pi / 2 + 2 * np.pi * index / configuration.cameras
    height = _HEIGHT + _HEIGHT_SPREAD * np.sin(2.4 * index)
    centre = np.array(
        [configuration.distance_m * np.cos(angle), configuration.distance_m * np.sin(angle), height]
    )
    rotation = look_at(centre, _TARGET)
    camera = Camera(
        name=f"cam{index:02d}",
        width=configuration.width,
        height=configuration.height,
        K=np.eye(3),
        R=rotation,
        t=-rotation @ centre,
    )
    return replace(camera, K=_intrinsics(camera, 1.0))


def _intrinsics(camera: Camera, focal: float) -> NDArray[np.float64]:
    return np.array(
        [[focal, 0.0, camera.width / 2], [0.0, focal, camera.height / 2], [0.0, 0.0, 1.0]]
    )


def _largest_focal(camera: Camera, vertices: NDArray[np.float64]) -> float:
    seen = camera.to_camera(vertices.reshape(-1, 3))
    slopes = np.abs(seen[:, :2] / seen[:, 2:]).max(axis=0)
    return float(0.5 * _FILLED * min(camera.width / slopes[0], camera.height / slopes[1]))
