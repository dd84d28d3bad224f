"""The square around the person over which a view is scored."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.metrics.ssim import WINDOW_PX

Pixel = TypeVar("Pixel", bound=np.generic)


@dataclass(frozen=True)
class Crop:
    """A square of pixels, which may reach over the image's border."""

    top: int
    left: int
    side: int

    def of(self, image: NDArray[Pixel], outside: float | bool) -> NDArray[Pixel]:
        """The square of an image (H, W, ...); pixels beyond the border are ``outside``."""
        height, width = image.shape[:2]
        square = np.full((self.side, self.side, *image.shape[2:]), outside, image.dtype)
        top, left = max(self.top, 0), max(self.left, 0)
        bottom, right = min(self.top + self.side, height), min(self.left + self.side, width)
        if bottom > top and right > left:
            square[top - self.top : bottom - self.top, left - self.left : right - self.left] = (
                image[top:bottom, left:right]
            )
        return square


def bounding_box(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """(top, left, bottom, right) of the true pixels, ends exclusive; the mask has some."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1


def crop_side(masks: Iterable[NDArray[np.bool_]], reference_share: float, box_margin: float) -> int:
    """Side of the crop in pixels, one for all scored views of a scene.

    Args:
        masks: truth masks (H, W) of every scored view; empty ones count by their size alone.
        reference_share: the paper's crop as a share of the image height.
        box_margin: the side is at least this many times the largest box around a mask.
    """
    side = float(WINDOW_PX)
    for mask in masks:
        side = max(side, reference_share * mask.shape[0])
        if mask.any():
            top, left, bottom, right = bounding_box(mask)
            side = max(side, box_margin * max(bottom - top, right - left))
    return math.ceil(side)


def crop_around(mask: NDArray[np.bool_], side: int) -> Crop:
    """The crop centred on the box of a truth mask (H, W) with at least one true pixel."""
    top, left, bottom, right = bounding_box(mask)
    return Crop(
        top=(top + bottom - side) // 2,
        left=(left + right - side) // 2,
        side=side,
    )
