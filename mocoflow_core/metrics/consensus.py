"""How well the two directions of the motion agree, in millimetres."""

from __future__ import annotations

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.correspondence import MM_PER_M, MotionMap, Points, carry


def consensus_local_mm(
    points: Points, frame_index: int, to_canonical: MotionMap, to_observed: MotionMap
) -> float:
    """Mean distance between body points (N, 3) and their way to canonical space and back.

    Source: MoCo-Flow Eq. 3, here as a distance (the loss takes coordinates apart).
    """
    return _mean_distance(
        carry(points, frame_index, frame_index, to_canonical, to_observed), points
    )


def consensus_global_mm(
    points: Points,
    frame_index: int,
    other_frame: int,
    to_canonical: MotionMap,
    to_observed: MotionMap,
) -> float:
    """Mean distance between body points (N, 3) and their way to another frame and back.

    Source: MoCo-Flow Eq. 2, here as a distance.
    """
    there = carry(points, frame_index, other_frame, to_canonical, to_observed)
    back = carry(there, other_frame, frame_index, to_canonical, to_observed)
    return _mean_distance(back, points)


def _mean_distance(moved: Points, points: Points) -> float:
    if len(points) == 0:
        raise InputError("points on the body", "none", "Leave this frame out.")
    return MM_PER_M * float(np.linalg.norm(moved - points, axis=-1).mean())
