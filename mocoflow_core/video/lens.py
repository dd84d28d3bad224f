"""The focal length of a video: said, written in the file, or guessed."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

# A full-frame picture's diagonal, to which "35 mm equivalent" focal lengths refer.
FULL_FRAME_DIAGONAL_MM = 43.27
# Main cameras of phones have 24 to 28 mm, of which stabilisation cuts off the border: 26 to 36.
USUAL_EQUIVALENT_MM = 30.0
USUAL_ERROR = 0.2
# A metadata value outside is of something else.
EQUIVALENT_MM = (8.0, 300.0)
_EQUIVALENT_KEYS = ("35mm", "focallengthin35", "focal_length_35")


def camera_of_video(
    name: str,
    video_size: tuple[int, int],
    size: tuple[int, int],
    focal_px: float | None,
    metadata: Mapping[str, str],
) -> tuple[Camera, str]:
    """A pinhole that is the world itself, for frames of ``size``; where its focal length is from.

    Args:
        video_size: width and height of the video's pictures, to whose pixels ``focal_px`` refers.
        metadata: of the file, keys in lower case.

    Raises InputError for a focal length of no camera.
    """
    width, height = video_size
    focal, said = _focal_length(math.hypot(width, height), focal_px, metadata)
    if not 0.2 < focal / max(width, height) < 20:
        raise InputError(
            f"a focal length in pixels of the video's {width} x {height}",
            f"{focal:g}",
            "Give another one with --focal.",
        )
    K = np.array(((focal, 0, width / 2), (0, focal, height / 2), (0, 0, 1)))
    camera = Camera(name, width, height, K, np.eye(3), np.zeros(3))
    return camera.resized(*size), said


def _focal_length(
    diagonal_px: float, given_px: float | None, metadata: Mapping[str, str]
) -> tuple[float, str]:
    if given_px is not None:
        return given_px, f"the focal length is {given_px:g} px, as given"
    for key, text in metadata.items():
        if any(part in key for part in _EQUIVALENT_KEYS) and (found := _number(text)):
            focal = found / FULL_FRAME_DIAGONAL_MM * diagonal_px
            return focal, (
                f"the focal length is {focal:.0f} px: {found:g} mm (35 mm equivalent) by the "
                f"file's {key}; where stabilisation cuts off the border it is up to 20 % more"
            )
    focal = USUAL_EQUIVALENT_MM / FULL_FRAME_DIAGONAL_MM * diagonal_px
    return focal, (
        f"caution: the focal length is guessed: {focal:.0f} px ({USUAL_EQUIVALENT_MM:g} mm "
        f"equivalent, usual of phones) with an error of up to {100 * USUAL_ERROR:.0f} %, and so is "
        "the distance; give a better one with --focal"
    )


def _number(text: str) -> float | None:
    try:
        value = float(text.split()[0])
    except (ValueError, IndexError):
        return None
    return value if EQUIVALENT_MM[0] <= value <= EQUIVALENT_MM[1] else None
