"""From OpenCV's pixels, whose centres are integers, to the corner origin of this project."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

_CENTRE_OF_PIXEL = 0.5


def corner_origin(K: NDArray[np.float64]) -> NDArray[np.float64]:
    """An intrinsic matrix (3, 3) of an OpenCV calibration with the origin in the image's corner."""
    moved = np.array(K, np.float64)
    moved[:2, 2] += _CENTRE_OF_PIXEL
    return moved


def rotation_matrix(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix (3, 3) of a Rodrigues vector (3,)."""
    matrix: NDArray[np.float64] = Rotation.from_rotvec(rotation).as_matrix()
    return matrix
