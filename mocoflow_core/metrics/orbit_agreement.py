"""Whether one moment shows the same body from every side: points found in the views must meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.metrics.correspondence import MM_PER_M
from mocoflow_core.perception.person import Keypoints

LEAST_VIEWS = 3  # Two lines of sight nearly always meet somewhere.


def triangulate(cameras: Sequence[Camera], places: NDArray[np.floating]) -> NDArray[np.float64]:
    """World point (3,) whose projections lie nearest to places (N, 2) px, by linear least squares.

    A first estimate gives the depths by which the equations are divided, so that what is made
    small is close to pixels.
    """
    rows = []
    for camera, place in zip(cameras, places, strict=True):
        x, y = np.linalg.solve(camera.K, [*place, 1.0])[:2]
        pose = np.column_stack([camera.R, camera.t])
        rows += [x * pose[2] - pose[0], y * pose[2] - pose[1]]
    system = np.stack(rows)
    point = np.linalg.lstsq(system[:, :3], -system[:, 3], rcond=None)[0]
    depths = [camera.to_camera(point[None])[0, 2] for camera in cameras]
    weighted = system / np.repeat(np.maximum(np.abs(depths), 1e-6), 2)[:, None]
    return np.linalg.lstsq(weighted[:, :3], -weighted[:, 3], rcond=None)[0]


def residuals_mm(
    cameras: Sequence[Camera], poses: Sequence[Keypoints | None], least_confidence: float
) -> NDArray[np.float64]:
    """Distances (17,) at which the lines of sight to each keypoint miss their common point.

    Each keypoint is triangulated from the views in which it is confident; its residual is the
    mean over them of the pixels by which the point's projection misses, carried to the point's
    depth. NaN where fewer than three views are confident. A body that looks different from every
    side, or a detector that errs, makes it large: compare with the same of another method.

    Args:
        cameras: undistorted, one for each pose.
        poses: of one moment.
    """
    found = np.full(17, np.nan)
    for point in range(17):
        sure = [
            (camera, pose.places[point])
            for camera, pose in zip(cameras, poses, strict=True)
            if pose is not None and pose.confidence[point] >= least_confidence
        ]
        if len(sure) >= LEAST_VIEWS:
            found[point] = _residual([camera for camera, _ in sure], np.array([p for _, p in sure]))
    return found


def _residual(cameras: Sequence[Camera], places: NDArray[np.floating]) -> float:
    world = triangulate(cameras, places)
    misses = []
    for camera, place in zip(cameras, places, strict=True):
        # Lines that diverge meet behind a camera: they miss by as much there.
        depth = abs(camera.to_camera(world[None])[0, 2])
        miss_px = np.linalg.norm(camera.project(world[None])[0] - place)
        misses.append(MM_PER_M * miss_px * depth / np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    return float(np.mean(misses))
