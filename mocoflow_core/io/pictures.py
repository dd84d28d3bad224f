"""Pictures on disk: 8-bit PNG, sRGB as it stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mocoflow_core.errors import InputError
from mocoflow_core.io.whole_file import whole_file


def as_bytes(unit: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Values in [0, 1] as the nearest bytes."""
    return np.round(255.0 * np.clip(unit, 0.0, 1.0)).astype(np.uint8)


def write_picture(path: Path, pixels: NDArray[np.uint8]) -> None:
    """An RGB (H, W, 3) or grey (H, W) picture; its folder is made where it is missing.

    The file appears complete or not at all.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as beside:
        Image.fromarray(pixels).save(beside, compress_level=3)


def read_picture(path: Path) -> NDArray[np.uint8]:
    """The pixels of a picture, RGB or grey as it is stored."""
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("L" if image.mode in ("1", "L") else "RGB"))
    except OSError as error:
        raise InputError(
            "A picture that can be decoded", f"{path} ({error})", "Give a PNG or JPEG file."
        ) from error
