"""Cameras of AIST++: which setting a sequence was filmed in, and each setting's calibration."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.opencv_calibration import corner_origin, rotation_matrix
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

# Width against height may be off by so much before a picture is no smaller copy.
SAME_SHAPE = 0.01
_SHAPES = {"matrix": (3, 3), "rotation": (3,), "translation": (3,), "distortions": (5,)}


def read_mapping(file: Path) -> dict[str, str]:
    """The setting of each sequence: ``<sequence> <setting>`` a line, whitespace between.

    Raises InputError for a line of anything else.
    """
    mapping = {}
    for number, line in enumerate(file.read_text(encoding="utf-8-sig").splitlines(), start=1):
        words = line.split()
        if len(words) == 2:
            mapping[words[0]] = words[1]
        elif words:
            raise InputError(
                f"'<sequence> <setting>' in line {number} of {file.name}",
                f"{line!r:.60}",
                "Take the file as it was distributed.",
            )
    return mapping


def read_cameras(folder: Path, sequence: str, unit_m: float) -> dict[str, Camera]:
    """The cameras that filmed a sequence, by name, for pictures of the calibrated size.

    Args:
        folder: ``cameras/`` with ``mapping.txt`` and the settings' files.
        unit_m: metres of one unit of the data set's world.

    Raises InputError when the sequence or its setting is not there, and for incomplete cameras.
    """
    mapping = read_mapping(_require(folder / "mapping.txt", "the list of settings"))
    if sequence not in mapping:
        raise InputError(
            f"a sequence among the {len(mapping)} of mapping.txt", sequence, "Check its name."
        )
    setting = mapping[sequence]
    if not re.fullmatch(r"\w+", setting):
        raise InputError(
            "a setting's name in mapping.txt, as setting1", f"{setting!r:.60}", "Unpack it again."
        )
    file = _require(folder / f"{setting}.json", f"the cameras of {sequence}")
    cameras = [_camera(values, file.name, unit_m) for values in _listed(file)]
    return {camera.name: camera for camera in cameras}


def for_pictures(camera: Camera, width: int, height: int) -> Camera:
    """The camera of pictures that were made smaller (or larger) as a whole.

    Raises InputError when they have another shape.
    """
    if abs(width * camera.height / (height * camera.width) - 1) > SAME_SHAPE:
        raise InputError(
            f"pictures of {camera.name} shaped like {camera.width} x {camera.height}",
            f"{width} x {height}",
            "Its calibration does not belong to them; leave the view out with left_out_views.",
        )
    return (
        camera
        if (width, height) == (camera.width, camera.height)
        else camera.resized(width, height)
    )


def _require(file: Path, what: str) -> Path:
    if not file.is_file():
        raise InputError(
            f"{what} in {file.name}",
            f"no such file in {file.parent}",
            "Unpack the AIST++ annotations (cameras/, motions/, ...) as they are distributed.",
        )
    return file


def _listed(file: Path) -> list[object]:
    try:
        cameras = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{file.name} must be JSON", str(error), "Unpack it again.") from error
    if not isinstance(cameras, list) or not cameras:
        raise InputError(
            f"a list of cameras in {file.name}", f"{cameras!r:.40}", "Unpack it again."
        )
    return cameras


def _camera(listed: object, file: str, unit_m: float) -> Camera:
    values = cast(dict[str, Sequence[float]], listed)
    try:
        name, (width, height) = str(values["name"]), values["size"]
        if not re.fullmatch(r"c\d\d", name):
            raise ValueError(name)
        parts = {key: _numbers(values[key], shape) for key, shape in _SHAPES.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"name (c01), size, {', '.join(_SHAPES)} of each camera in {file}",
            f"{listed!r:.60}",
            "Unpack it again.",
        ) from error
    return Camera(
        name=name,
        width=int(width),
        height=int(height),
        K=corner_origin(parts["matrix"]),
        R=rotation_matrix(parts["rotation"]),
        t=unit_m * parts["translation"],
        distortion=parts["distortions"],
    )


def _numbers(value: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Raises ValueError for another count, or numbers that are not finite."""
    numbers = np.asarray(value, dtype=np.float64).reshape(shape)
    if not np.isfinite(numbers).all():
        raise ValueError("not finite")
    return numbers
