"""Cameras of ZJU-MoCap with their pictures and masks, in the project's conventions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mocoflow_core.capture.frame_source import ImageFrames
from mocoflow_core.datasets.dataset_scene import DatasetCamera
from mocoflow_core.datasets.opencv_calibration import corner_origin
from mocoflow_core.datasets.zju_annotations import ZjuAnnotations, ZjuCalibration
from mocoflow_core.datasets.zju_masks import MaskChoice, find_masks
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

Indices = NDArray[np.int32]
# The paper's camera with ID 01, under both namings.
FIRST_CAMERAS = ("Camera_B1", "Camera_1")


def choose_camera(annotations: ZjuAnnotations, wanted: str | None) -> str:
    """The camera of that name; ``B1``, ``1`` and the folder's own name will do. By default 01.

    Raises InputError when there is none.
    """
    names = list(annotations.calibrations)
    for candidate in FIRST_CAMERAS if wanted is None else _spellings(wanted):
        if candidate in names:
            return candidate
    raise InputError(
        "a camera of this subject",
        f"{wanted or 'neither Camera_B1 nor Camera (1)'}",
        f"There are {', '.join(names)}.",
    )


def recorded_frames(
    folder: Path, annotations: ZjuAnnotations, name: str, masks: MaskChoice
) -> tuple[Indices, Indices]:
    """Frame numbers of a camera that have a picture, and those that have a picture and a mask."""
    pictures = _present(folder, annotations.pictures[name])
    masked = find_masks(folder, pictures, masks, (0, 0)).indices
    return np.array(sorted(pictures), np.int32), masked


def open_camera(
    folder: Path,
    annotations: ZjuAnnotations,
    name: str,
    wanted: Sequence[int],
    masks: MaskChoice,
) -> tuple[DatasetCamera | None, tuple[str, ...]]:
    """A camera with those of the wanted frames that there are, and remarks about the others.

    None when it has no picture of them.
    """
    listed = annotations.pictures[name]
    pictures = _present(folder, {number: listed[number] for number in wanted if number in listed})
    if not pictures:
        return None, (f"{name} is left out: it has no picture of the clip",)
    images = {number: folder / path for number, path in pictures.items()}
    camera = _camera(name, annotations.calibrations[name], _size(next(iter(images.values()))))
    found = find_masks(folder, pictures, masks, (camera.width, camera.height))
    remarks = []
    if missing := len(wanted) - len(images):
        remarks.append(f"{missing} of {len(wanted)} pictures of {name} are missing")
    if missing := len(images) - len(found.indices):
        remarks.append(f"{missing} of {len(images)} masks of {name} are missing")
    return DatasetCamera(camera, ImageFrames(images), found), tuple(remarks)


def _spellings(wanted: str) -> list[str]:
    plain = wanted.replace(" ", "_").replace("(", "").replace(")", "").strip("_")
    return [wanted, plain, f"Camera_{plain}", f"Camera_B{plain.lstrip('0')}"]


def _present(folder: Path, pictures: dict[int, PurePosixPath]) -> dict[int, PurePosixPath]:
    return {number: path for number, path in pictures.items() if (folder / path).is_file()}


def _camera(name: str, calibration: ZjuCalibration, size: tuple[int, int]) -> Camera:
    return Camera(
        name=name,
        width=size[0],
        height=size[1],
        K=corner_origin(calibration.K),
        R=calibration.R,
        t=calibration.t,
        distortion=calibration.distortion,
    )


def _size(path: Path) -> tuple[int, int]:
    """Width and height, from the header alone."""
    try:
        with Image.open(path) as image:
            return image.size
    except OSError as error:
        name = f"{path.parent.name}/{path.name}"
        raise InputError("a picture that can be decoded", name, "Copy the file again.") from error
