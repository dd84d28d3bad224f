"""The pinhole camera with OpenCV axes and a corner-origin intrinsic matrix."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _no_distortion() -> Array:
    return np.zeros(5)


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera: x right, y down, z forward; ``X_cam = R X_world + t``.

    ``K`` has the corner origin: the centre of the top-left pixel is at (0.5, 0.5).
    ``distortion`` is ``k1, k2, p1, p2, k3`` of the OpenCV model. Lengths are metres.
    """

    name: str
    width: int
    height: int
    K: Array  # (3, 3) pixels
    R: Array  # (3, 3) world -> camera
    t: Array  # (3,) metres
    distortion: Array = field(default_factory=_no_distortion)  # (5,)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    @property
    def centre_world(self) -> Array:
        """Position of the camera, (3,) world metres."""
        return -self.R.T @ self.t

    @property
    def is_pinhole(self) -> bool:
        return not np.any(self.distortion)

    def to_camera(self, points_world: Array) -> Array:
        """World points (..., 3) in the camera's axes, metres."""
        return points_world @ self.R.T + self.t

    def to_world(self, points_camera: Array) -> Array:
        """Camera-space points (..., 3) in world metres."""
        return (points_camera - self.t) @ self.R

    def project(self, points_world: Array) -> Array:
        """Pinhole projection of world points (..., 3) to pixels (..., 2), corner origin."""
        projected = self.to_camera(points_world) @ self.K.T
        return projected[..., :2] / projected[..., 2:]

    def resized(self, width: int, height: int) -> Camera:
        """The same camera after its image is resized; exact for the corner origin."""
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return replace(self, width=width, height=height, K=scale @ self.K)

    def undistorted(self) -> Camera:
        """The same camera for an image whose distortion has been removed with ``K`` kept."""
        return replace(self, distortion=_no_distortion())

    def to_json(self) -> dict[str, object]:
        """Plain values, as in ``scene.json``."""
        return {
            "width": self.width,
            "height": self.height,
            "K": self.K.tolist(),
            "distortion": self.distortion.tolist(),
            "R": self.R.tolist(),
            "t": self.t.tolist(),
        }

    @classmethod
    def from_json(cls, name: str, values: dict[str, object]) -> Camera:
        """Inverse of ``to_json``."""
        return cls(
            name=name,
            width=int(values["width"]),  # type: ignore[call-overload]
            height=int(values["height"]),  # type: ignore[call-overload]
            K=np.asarray(values["K"], dtype=np.float64),
            R=np.asarray(values["R"], dtype=np.float64),
            t=np.asarray(values["t"], dtype=np.float64),
            distortion=np.asarray(values.get("distortion", [0.0] * 5), dtype=np.float64),
        )
