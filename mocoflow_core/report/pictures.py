"""Pictures and videos inside the page itself, as data URIs."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image

from mocoflow_core.metrics.crop import Crop, bounding_box

Picture = NDArray[np.uint8]  # (H, W, 3) sRGB-encoded

# A difference of half the range is drawn in the darkest colour.
LARGEST_DIFFERENCE = 0.5
# Tried from large to small until all pictures together fit.
SIDES_PX = (640, 480, 360, 280, 200, 140, 96)
WEBP_QUALITY = 82
# WebP halves the resolution of colours, which smears the edges of a smaller picture.
LEAST_SIDE_PX = 240
NEARLY_WHITE = 250
MARGIN = 0.06  # around a person, of the window's longer side


def read_picture(path: Path) -> Picture:
    """An image file as RGB bytes."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def fitted(picture: Picture, side_px: int) -> Picture:
    """The picture with its longer side at most ``side_px``, and not tiny if that allows it."""
    longer = max(picture.shape[:2])
    wanted = min(max(longer, LEAST_SIDE_PX), side_px)
    if wanted == longer:
        return picture
    height, width = (max(round(wanted / longer * size), 1) for size in picture.shape[:2])
    method = cv2.INTER_AREA if wanted < longer else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, (width, height), interpolation=method), np.uint8)


def difference_picture(picture: Picture, reference: Picture) -> Picture:
    """Mean absolute difference over the channels: white where equal, dark where far apart."""
    distance = np.abs(picture.astype(np.float32) - reference.astype(np.float32)).mean(axis=-1)
    share = (distance / (255.0 * LARGEST_DIFFERENCE)).clip(0.0, 1.0)
    return np.round(255.0 * colormaps["gist_heat_r"](share)[..., :3]).astype(np.uint8)


def cut_to_person(rows: list[list[Picture]]) -> list[list[Picture]]:
    """Windows of one size, each around what the first two of its row show."""
    inked = [np.minimum(*row[:2]).min(axis=-1) < NEARLY_WHITE for row in rows]
    boxes = [bounding_box(ink) if ink.any() else (0, 0, *ink.shape) for ink in inked]
    height = max((bottom - top for top, _, bottom, _ in boxes), default=0)
    width = max((right - left for _, left, _, right in boxes), default=0)
    spare = round(MARGIN * max(height, width))
    size = (height + spare, width + spare)
    return [
        [_window(picture, box, size) for picture in row]
        for row, box in zip(rows, boxes, strict=True)
    ]


def _window(picture: Picture, box: tuple[int, int, int, int], size: tuple[int, int]) -> Picture:
    """A part of the picture around the middle of a box, white beyond the picture's border."""
    side = max(size)
    row, column = (box[0] + box[2] - side) // 2, (box[1] + box[3] - side) // 2
    square = Crop(row, column, side).of(picture, 255)
    top, left = (side - size[0]) // 2, (side - size[1]) // 2
    return square[top : top + size[0], left : left + size[1]]


def webp(picture: Picture) -> bytes:
    """The picture as a WebP file."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "WEBP", quality=WEBP_QUALITY, method=4)
    return buffer.getvalue()


def webps_within(pictures: Sequence[Picture], budget_bytes: int) -> list[bytes]:
    """All pictures as WebP files, as large as fits into the budget together."""
    files: list[bytes] = []
    for side in SIDES_PX:
        files = [webp(fitted(picture, side)) for picture in pictures]
        if sum(map(len, files)) <= budget_bytes:
            break
    return files


def data_uri(content: bytes, media_type: str) -> str:
    """The content as text that a page can carry."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode('ascii')}"
