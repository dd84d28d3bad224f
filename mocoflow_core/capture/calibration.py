"""What a calibration must satisfy to be one."""

from __future__ import annotations

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

# Calibrations are stored with four or more digits; a transposed or scaled matrix is far outside.
ROTATION_TOLERANCE = 1e-3


def require_calibration(camera: Camera, file: str) -> None:
    """Raise InputError unless R is a rotation and K a pinhole's; ``file`` says where they stand."""
    _require_rotation(camera, file)
    _require_intrinsics(camera, file)


def _require_rotation(camera: Camera, file: str) -> None:
    error = float(np.abs(camera.R @ camera.R.T - np.eye(3)).max())
    determinant = float(np.linalg.det(camera.R))
    # Not "error > tolerance", which NaN would pass.
    if not (error <= ROTATION_TOLERANCE and determinant > 0):
        raise InputError(
            f"R of {camera.name} must be a rotation (orthonormal, determinant +1)",
            f"R R^T off by {error:.3g}, determinant {determinant:.3g}",
            "Give the world-to-camera rotation in OpenCV axes, without scale or mirror, "
            f"in {file}.",
        )


def _require_intrinsics(camera: Camera, file: str) -> None:
    K = camera.K
    affine = np.allclose(K[2], [0, 0, 1]) and K[1, 0] == 0
    if not (affine and K[0, 0] > 0 and K[1, 1] > 0):
        raise InputError(
            f"K of {camera.name} must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0",
            f"{K.tolist()}",
            f"Correct K in {file}.",
        )
