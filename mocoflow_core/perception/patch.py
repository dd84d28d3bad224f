"""Square patches of pictures at the size that a network takes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from mocoflow_core.perception.person import Picture


class Square(NamedTuple):
    """A square of whole pixels, which may reach over the picture's border."""

    left: int
    top: int
    side: int

    def sample(self, picture: Picture, size: int) -> Picture:
        """The square as (size, size, 3); the border's colour goes on beyond it.

        Small pictures are enlarged bilinearly, large ones averaged over areas, so that nothing
        aliases.
        """
        height, width = picture.shape[:2]
        right, bottom = self.left + self.side, self.top + self.side
        rows = np.clip(np.arange(self.top, bottom), 0, height - 1)
        columns = np.clip(np.arange(self.left, right), 0, width - 1)
        inside = self.left >= 0 and self.top >= 0 and right <= width and bottom <= height
        patch = (
            picture[self.top : bottom, self.left : right]
            if inside
            else picture[rows[:, None], columns[None, :]]
        )
        how = cv2.INTER_AREA if self.side > size else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(patch, (size, size), interpolation=how), np.uint8)

    def to_picture(self, places: NDArray[np.floating], size: int) -> NDArray[np.float32]:
        """Places (..., 2) of the sampled patch as places of the picture."""
        corner = np.array([self.left, self.top], np.float32)
        return (places * (self.side / size) + corner).astype(np.float32)


def whole_picture(picture: Picture) -> Square:
    """The smallest square over all of a picture (H, W, 3), centred on it."""
    height, width = picture.shape[:2]
    side = max(height, width)
    return Square((width - side) // 2, (height - side) // 2, side)


def around_box(box: NDArray[np.floating], margin: float) -> Square:
    """The square around a box (4,), ``margin`` times its longer side."""
    x0, y0, x1, y1 = (float(value) for value in box)
    side = max(round(margin * max(x1 - x0, y1 - y0)), 1)
    return Square(round(0.5 * (x0 + x1 - side)), round(0.5 * (y0 + y1 - side)), side)


def batches(patches: Sequence[NDArray[np.uint8]], count: int) -> Iterator[torch.Tensor]:
    """Patches (size, size, 3) as float tensors (at most ``count``, 3, size, size) of bytes."""
    for start in range(0, len(patches), count):
        stacked = np.stack(patches[start : start + count]).transpose(0, 3, 1, 2)
        yield torch.from_numpy(np.ascontiguousarray(stacked)).float()
