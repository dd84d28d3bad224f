"""Which way is up, as the cameras of a studio stand: people hold cameras upright."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.scene import UP_VECTORS
from mocoflow_core.datasets.dataset_scene import Up
from mocoflow_core.errors import InputError

# Cameras that look down steeply still have more than this of their up along the world's.
LEAST_AGREEMENT = 0.7


def up_of_cameras(rotations: Iterable[NDArray[np.float64]], expected: Up) -> tuple[Up, str]:
    """The world axis nearest to the mean up of the cameras, and a remark that says so.

    Args:
        rotations: (3, 3) each, world to camera, of all cameras that were calibrated: which of
            them evaluate must not matter.
        expected: what the data set's real files show; another result is remarked.

    Raises InputError where the mean lies along no axis.
    """
    mean = -np.mean([R[1] for R in rotations], axis=0)
    vector = f"({', '.join(f'{value:.2f}' for value in mean)})"
    nearest = max(UP_VECTORS, key=lambda name: float(UP_VECTORS[name] @ mean))
    if float(UP_VECTORS[nearest] @ mean) < LEAST_AGREEMENT:
        raise InputError(
            "cameras whose mean up lies along an axis of the world",
            f"{vector}",
            "Say which axis is up with the field up.",
        )
    remark = f"up is {nearest}: the mean up of the cameras is {vector}"
    if nearest != expected:
        remark += f"; in the known files of this data set it is {expected}"
    up: Up = nearest  # type: ignore[assignment]
    return up, remark
