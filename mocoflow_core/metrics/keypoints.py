"""Distance of body keypoints from the truth, split at the train camera's line of sight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.metrics.correspondence import MM_PER_M, MotionMap, Points, carry


class KeypointErrors(NamedTuple):
    """Means over the known keypoints of each frame, in mm; NaN where a frame knows none."""

    keypoint_mm: NDArray[np.float64]  # (T,) distance in space
    keypoint_lateral_mm: NDArray[np.float64]  # (T,) across the line of sight
    keypoint_depth_mm: NDArray[np.float64]  # (T,) along the line of sight, absolute


def keypoint_errors(keypoints: Points, truth: Points, camera: Camera) -> KeypointErrors:
    """Errors of each frame, and their parts across and along the sight of ``camera``.

    One camera sees the lateral part; the depth is what a single view knows least. For each
    keypoint ``distance^2 = lateral^2 + depth^2``.

    Args:
        keypoints, truth: (T, K, 3) world metres; NaN in either leaves the keypoint out.
        camera: the train camera.
    """
    if keypoints.shape != truth.shape:
        raise InputError(
            f"keypoints like the truth's {truth.shape}",
            str(keypoints.shape),
            "Join both on the source frame numbers.",
        )
    sight = truth - camera.centre_world
    sight = sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    error = keypoints - truth
    along = np.einsum("tkc,tkc->tk", error, sight)
    across = np.linalg.norm(error - along[..., None] * sight, axis=-1)
    distance = np.linalg.norm(error, axis=-1)
    return KeypointErrors(*(_known_mean(part) for part in (distance, across, np.abs(along))))


def regress_keypoints(regressor: NDArray[np.floating], vertices: NDArray[np.floating]) -> Points:
    """Keypoints (T, K, 3) as fixed mixtures (K, V) of mesh vertices (T, V, 3)."""
    return np.einsum("kv,tvc->tkc", regressor, vertices.astype(np.float64))


def carried_keypoints(
    truth: Points,
    frame_indices: NDArray[np.integer],
    pairs: Sequence[tuple[int, int]],
    to_canonical: MotionMap,
    to_observed: MotionMap,
) -> tuple[Points, Points]:
    """True keypoints carried by the motion, and what they should have become.

    This needs no regressor: a mesh of any topology, or none, can be judged by it.

    Args:
        truth: (T, K, 3) world metres, NaN = unknown.
        pairs: (from, to) source numbers.

    Returns:
        Carried and true keypoints (P, K, 3) at the ``to`` frame of each pair; a keypoint
        unknown in either frame is NaN in one of them.
    """
    rows = {int(index): row for row, index in enumerate(frame_indices)}
    carried = np.full((len(pairs), *truth.shape[1:]), np.nan)
    for pair, (start, end) in enumerate(pairs):
        points = truth[rows[start]]
        known = np.isfinite(points).all(axis=-1)
        if known.any():
            carried[pair, known] = carry(points[known], start, end, to_canonical, to_observed)
    return carried, truth[[rows[end] for _, end in pairs]]


def _known_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean (T,) in mm over the finite values of (T, K) metres, NaN where there are none."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    total = np.where(known, values, 0.0).sum(axis=1)
    return MM_PER_M * np.where(count > 0, total / np.maximum(count, 1), np.nan)
