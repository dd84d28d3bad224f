"""The person from all sides while time goes on: a camera on a circle around the body."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.orbit import moved_around
from mocoflow_core.rendering.trained_scene import TrainedScene


def orbit(
    scene: TrainedScene, camera: Camera, up: NDArray[np.float64], times: NDArray[np.float64]
) -> Iterator[Camera]:
    """One full turn around the upright axis through the body, a camera for each time.

    The first camera is the given one; the body keeps its place in the image as it walks.
    """
    for number, time in enumerate(times):
        angle = 2.0 * np.pi * number / len(times)
        yield moved_around(camera, angle * up, body_centre(scene, time))


def body_centre(scene: TrainedScene, time: float) -> NDArray[np.float64]:
    """Mean of the body's control points at a normalised time, (3,) world metres."""
    return scene.controls.at_time(time).observed[0].mean(axis=0).astype(np.float64)
