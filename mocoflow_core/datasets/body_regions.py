"""Where located bodies cover a camera's pictures: where masks and plates have to look."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.datasets.dataset_scene import Mask
from mocoflow_core.geometry.camera import Camera

# Silhouettes are drawn at this size at most, and grown for clothes and for the lens distortion,
# which they leave out, or shrunk for the fit's errors; shares of the longer side.
LONGER_SIDE_PX = 384
NEAR = 0.03
INSIDE = 0.01


@dataclass(frozen=True, eq=False)
class BodyRegion:
    """About where a body is in one picture; each (H, W)."""

    inside: Mask  # on it, away from its outline
    on: Mask
    near: Mask  # on it and around it


@dataclass(frozen=True, eq=False)
class BodyRegions:
    """Regions of bodies in world metres, at the size of the camera's pictures."""

    bodies: MeshSequence
    camera: Camera

    @property
    def numbers(self) -> NDArray[np.int32]:
        """(T,) source numbers that have a body."""
        return self.bodies.frame_indices

    def at(self, number: int) -> BodyRegion:
        """The region of a source number that has a body."""
        width, height = self.camera.width, self.camera.height
        scale = min(1.0, LONGER_SIDE_PX / max(width, height))
        small = self.camera.resized(round(width * scale), round(height * scale))
        body = self.bodies.at(np.array([number], np.int32))
        on = silhouettes(body.vertices, body.faces, small)[0].astype(np.uint8)
        shares = {share: _disc(share * max(on.shape)) for share in (INSIDE, NEAR)}
        inside, near = cv2.erode(on, shares[INSIDE]), cv2.dilate(on, shares[NEAR])
        return BodyRegion(*(self._enlarged(part) for part in (inside, on, near)))

    def _enlarged(self, small: cv2.typing.MatLike) -> Mask:
        size = (self.camera.width, self.camera.height)
        return np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_NEAREST) > 0)


def _disc(radius: float) -> cv2.typing.MatLike:
    side = 2 * round(radius) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
