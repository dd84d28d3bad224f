"""``annots.npy`` of ZJU-MoCap: calibrations and picture lists, in all the variants of it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.zju_lookalikes import (
    lookalike_tree,
    refuse_lookalike_content,
    refuse_lookalike_tree,
)
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_untrusted

Array = NDArray[np.float64]
LengthUnit = Literal["millimetres", "metres"]
ANNOTATION_FILES = ("annots.npy", "annots_python2.npy", "annots.json")
METRES_PER_UNIT = {"millimetres": 1e-3, "metres": 1.0}
# Distances of a studio's cameras from its origin, metres.
STUDIO_DISTANCE_M = (0.5, 50.0)
# Of ``CoreView_313_Camera_(1)_0001_2019-08-23_16-08-50.592``, split at the underscores.
_NUMBER_TOKEN = 4
_SHAPES = {"K": (3, 3), "D": (5,), "R": (3, 3), "T": (3,)}


@dataclass(frozen=True, eq=False)
class ZjuCalibration:
    """One camera as calibrated with OpenCV: pixel centres at integers."""

    K: Array  # (3, 3) pixels
    distortion: Array  # (5,) k1, k2, p1, p2, k3
    R: Array  # (3, 3) world -> camera
    t: Array  # (3,) metres


@dataclass(frozen=True, eq=False)
class ZjuAnnotations:
    """Calibrations by camera name, and each camera's pictures by frame number."""

    calibrations: dict[str, ZjuCalibration]
    pictures: dict[str, dict[int, PurePosixPath]]  # relative to the subject's folder


def read_annotations(folder: Path, unit: LengthUnit = "millimetres") -> ZjuAnnotations:
    """Read the annotations of one subject's folder. No picture is looked at.

    Cameras are named by the folders of their pictures (``Camera_B1``; ``Camera_1`` for
    ``Camera (1)``), frames by the numbers in the pictures' names.

    Raises InputError for a folder or file that only looks like ZJU-MoCap, for calibrations that
    are incomplete or in another unit, and for pictures outside the folder.
    """
    file = annotation_file(folder)
    if file is None:
        refuse_lookalike_tree(folder)
        raise InputError(
            "a ZJU-MoCap subject with annots.npy",
            f"none in {folder}",
            "Give the folder of one subject, such as CoreView_377.",
        )
    content = _content(file)
    refuse_lookalike_content(content, file.name)
    calibrations = _calibrations(content["cams"], unit)
    items = [_paths(item, number) for number, item in enumerate(content["ims"])]
    names = _camera_names(items, len(calibrations))
    pictures: dict[str, dict[int, PurePosixPath]] = {name: {} for name in names}
    for paths in items:
        for path in paths:
            name = camera_name(path)
            if name not in pictures:
                raise InputError("pictures of calibrated cameras", f"{path}", "Correct annots.npy.")
            pictures[name][frame_number(path)] = path
    return ZjuAnnotations(dict(zip(names, calibrations, strict=True)), pictures)


def annotation_file(folder: Path) -> Path | None:
    """The file that holds the annotations, if there is one."""
    return next((folder / name for name in ANNOTATION_FILES if (folder / name).is_file()), None)


def missing_parts(folder: Path) -> list[str]:
    """What a folder lacks to be a subject of ZJU-MoCap, in words."""
    if annotation_file(folder):
        return []
    what = lookalike_tree(folder)
    return [f"annots.npy (it is {what})" if what else "annots.npy", "pictures in Camera_B1 ..."]


def camera_name(path: PurePosixPath) -> str:
    """A file-name-safe camera name: ``Camera_B1`` as it is, ``Camera (1)`` as ``Camera_1``."""
    return re.sub(r"[^0-9A-Za-z]+", "_", path.parent.name).strip("_")


def frame_number(path: PurePosixPath) -> int:
    """The frame number in a picture's name: the whole stem, or its fifth token (313, 315)."""
    tokens = path.stem.split("_")
    for token in (path.stem, *tokens[_NUMBER_TOKEN : _NUMBER_TOKEN + 1]):
        if token.isdecimal():
            return int(token)
    raise InputError(
        "pictures named like 000012.jpg or CoreView_313_Camera_(1)_0012_<time>.jpg",
        path.name,
        "Keep the original file names.",
    )


def _content(file: Path) -> dict[str, Any]:
    """The dictionary in the file: a 0-d object array, or JSON."""
    if file.suffix == ".json":
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(f"{file.name} must be JSON", str(error), "Correct it.") from error
    else:
        content = read_untrusted(file)
    if isinstance(content, np.ndarray) and content.shape == ():
        content = content.item()
    if not isinstance(content, dict):
        raise InputError(
            f"{file.name} must hold a dictionary with cams and ims",
            type(content).__name__,
            "Take the file as it was distributed.",
        )
    return content


def _calibrations(cams: dict[str, Any], unit: LengthUnit) -> list[ZjuCalibration]:
    counts = {key: len(cams[key]) for key in _SHAPES}
    if len(set(counts.values())) != 1 or not counts["K"]:
        raise InputError(
            "as many K, D, R and T as cameras in annots.npy",
            ", ".join(f"{count} {key}" for key, count in counts.items()),
            "Take the file as it was distributed.",
        )
    parts = {
        key: [
            _numbers(value, shape, f"{key} of camera {row}") for row, value in enumerate(cams[key])
        ]
        for key, shape in _SHAPES.items()
    }
    scale = METRES_PER_UNIT[unit]
    calibrations = [
        ZjuCalibration(K, D, R, scale * T)
        for K, D, R, T in zip(parts["K"], parts["D"], parts["R"], parts["T"], strict=True)
    ]
    _require_studio_size(calibrations, unit)
    return calibrations


def _numbers(value: object, shape: tuple[int, ...], what: str) -> Array:
    """Nested lists and arrays alike; (5, 1), (1, 5) and (5,) are the same."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.size != np.prod(shape) or not np.isfinite(numbers).all():
        size = " x ".join(map(str, shape))
        raise InputError(
            f"{what} must be {size} finite numbers",
            f"{value!r:.60}",
            "Take annots.npy as it was distributed.",
        )
    return numbers.reshape(shape)


def _require_studio_size(calibrations: list[ZjuCalibration], unit: LengthUnit) -> None:
    """Body files are in metres and T is in millimetres: mixing them is the classic mistake."""
    distances = [float(np.linalg.norm(calibration.t)) for calibration in calibrations]
    distance_m = float(np.median(distances))
    low, high = STUDIO_DISTANCE_M
    if not low <= distance_m <= high:
        other = "metres" if unit == "millimetres" else "millimetres"
        raise InputError(
            f"cameras {low:g} to {high:g} m from the origin, with T in {unit}",
            f"a median of {distance_m:.3g} m",
            f"If T of annots.npy is in {other}, say so with the field camera_unit.",
        )


def _paths(item: object, number: int) -> list[PurePosixPath]:
    """The pictures of one frame; ``kpts2d``, which some subjects add, is not looked at."""
    listed = item.get("ims") if isinstance(item, dict) else None
    if not isinstance(listed, Sequence | np.ndarray) or isinstance(listed, str | bytes):
        raise InputError(
            f"item {number} of ims must list its pictures under ims",
            f"{item!r:.60}",
            "Take annots.npy as it was distributed.",
        )
    return [_relative(str(path)) for path in listed]


def _relative(text: str) -> PurePosixPath:
    path = PurePosixPath(text.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or re.match(r"^[A-Za-z]:", text):
        raise InputError(
            "pictures inside the subject's folder", f"{text!r:.80}", "Use relative paths."
        )
    return path


def _camera_names(items: list[list[PurePosixPath]], count: int) -> list[str]:
    """Names in the order of the calibrations, from a frame that every camera saw."""
    complete = next((paths for paths in items if len(paths) == count), None)
    if complete is None:
        raise InputError(
            f"a frame with a picture of each of the {count} calibrated cameras",
            f"frames with {sorted({len(paths) for paths in items})} pictures",
            "Without one it is unknown which calibration belongs to which camera.",
        )
    names = [camera_name(path) for path in complete]
    if len(set(names)) != count or not all(names):
        raise InputError(
            "a folder of its own for each camera's pictures",
            f"{', '.join(names)}",
            "Keep the original folders.",
        )
    return names
