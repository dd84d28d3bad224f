"""A turned square of a picture, cut out for a network, and what was found in it put back."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.perception.person import Picture


@dataclass(frozen=True)
class Region:
    """A square around ``centre`` (x, y), turned clockwise by ``angle`` radians. Pixels."""

    centre: tuple[float, float]
    side: float
    angle: float = 0.0

    @classmethod
    def of_box(cls, corners: NDArray[np.floating], margin: float = 1.25) -> Region:
        """The upright square about a box (4,), its longer side times ``margin``."""
        x0, y0, x1, y1 = (float(value) for value in corners)
        return cls(((x0 + x1) / 2, (y0 + y1) / 2), margin * max(x1 - x0, y1 - y0))

    @classmethod
    def of_picture(cls, picture: Picture) -> Region:
        """The smallest upright square about the whole picture."""
        height, width = picture.shape[:2]
        return cls((width / 2, height / 2), float(max(width, height)))

    @property
    def corners(self) -> NDArray[np.float32]:
        """The upright square (4,) x0 y0 x1 y1 with the same middle and side."""
        (x, y), half = self.centre, self.side / 2
        return np.array((x - half, y - half, x + half, y + half), np.float32)

    def widened(self, factor: float) -> Region:
        return replace(self, side=self.side * factor)

    def cut(self, picture: Picture, size: int) -> Picture:
        """The region (size, size, 3), bilinear, black outside the picture."""
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        matrix = self._to_picture(size)
        return cv2.warpAffine(picture, matrix, (size, size), flags=flags)  # type: ignore[return-value]

    def places(self, inside: NDArray[np.floating]) -> NDArray[np.float32]:
        """Pixels (N, 2) of the picture at places (N, 2) of the region, [0, 1] across it."""
        turned = (inside - 0.5) * self.side @ self.rotation.T
        return (turned + np.array(self.centre)).astype(np.float32)

    def laid_back(self, mask: NDArray[np.floating], height: int, width: int) -> NDArray[np.float32]:
        """A map (S, S) of the region at its place in a picture (H, W), zero around it."""
        matrix = self._to_picture(len(mask))
        return cv2.warpAffine(
            mask.astype(np.float32), matrix, (width, height), flags=cv2.INTER_LINEAR
        )  # type: ignore[return-value]

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(2, 2), from the region's axes to the picture's."""
        sine, cosine = math.sin(self.angle), math.cos(self.angle)
        return np.array(((cosine, -sine), (sine, cosine)))

    def _to_picture(self, size: int) -> NDArray[np.float64]:
        """(2, 3) from pixel numbers of the cut to pixel numbers of the picture.

        Both count from the middle of the first pixel.
        """
        linear = self.rotation * (self.side / size)
        offset = np.array(self.centre) - 0.5 - linear @ np.full(2, (size - 1) / 2)
        return np.column_stack((linear, offset))
