"""The cameras of one AIST sequence with their videos, masks and plates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.datasets.aist_cameras import for_pictures
from mocoflow_core.datasets.aist_files import AistFiles
from mocoflow_core.datasets.aist_masks import (
    DifferenceMasks,
    PlateChoice,
    clip_plate,
    masks_in_folder,
)
from mocoflow_core.datasets.aist_names import NEVER_RELEASED
from mocoflow_core.datasets.aist_time import GRID_FPS, GridFrames, Rounding, ticks_of
from mocoflow_core.datasets.body_regions import BodyRegions
from mocoflow_core.datasets.dataset_scene import DatasetCamera, MaskSource
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.video import describe_video, read_frames

Indices = NDArray[np.int32]
# Rates within this of 60 drift by a frame now and then; others are no recording of AIST's.
USUAL_RATE = 0.02


@dataclass(frozen=True)
class ViewChoice:
    """How videos become frames, masks and plates."""

    rounding: Rounding
    masks: Path | None  # folder with <video name>/%06d.png
    plate: PlateChoice
    bodies: MeshSequence | None  # world metres; about where the person is


def present_views(
    files: AistFiles, cameras: Iterable[str], left_out: Iterable[str]
) -> tuple[list[str], tuple[str, ...]]:
    """Cameras whose video is there and wanted, and a remark about each other one."""
    present, remarks, unwanted = [], [], set(left_out)
    for camera in cameras:
        name = files.name.video(camera)
        if name in unwanted:
            remarks.append(f"{name} is left out: it is known to be wrong (left_out_views)")
        elif files.video(camera).is_file():
            present.append(camera)
        elif name in NEVER_RELEASED:
            remarks.append(f"{name} was never released")
        else:
            remarks.append(f"{name} is not there: the view is left out")
    return present, tuple(remarks)


def train_view(camera: str, present: list[str]) -> str:
    """The train camera. Raises InputError when its video is not among those present."""
    if camera not in present:
        raise InputError(
            f"the video of {camera}, the train camera",
            f"videos of {', '.join(present) or 'no camera'}",
            "Add it, or choose another with train_camera (the paper: c09, in its supplement c01).",
        )
    return camera


def available_ticks(video: Path, rounding: Rounding) -> tuple[Indices, tuple[str, ...]]:
    """Ticks of the 60 Hz grid that a video has frames for, and a remark about its rate."""
    description = describe_video(video)
    if description.fps <= 0:
        raise InputError(f"{video.name} must state its rate", "none", "Re-encode it at 60.")
    ticks = ticks_of(description, rounding)
    if description.fps == GRID_FPS:
        return ticks, ()
    remark = (
        f"{video.name} has {description.fps:.5g} frames per second: sampled on the 60 Hz grid of "
        f"the annotations, rounding {rounding}"
    )
    if abs(description.fps / GRID_FPS - 1) > USUAL_RATE:
        remark += "; AIST's own videos have about 60"
    return ticks, (remark,)


def open_view(
    files: AistFiles, camera: Camera, wanted: Indices, learned: Indices, choice: ViewChoice
) -> tuple[DatasetCamera, tuple[str, ...]]:
    """One camera with those of the wanted ticks that its video has; its plate is of the learned.

    Raises InputError for a video of another shape, and for masks that are not where they should.
    """
    video = files.video(camera.name)
    ticks, remarks = available_ticks(video, choice.rounding)
    frames = GridFrames(video, np.intersect1d(wanted, ticks), choice.rounding)
    if missing := len(wanted) - len(frames.indices):
        remarks += (f"{camera.name} ends {missing} wanted frames early",)
    _, first = next(read_frames(video, {0}))
    fitted = for_pictures(camera, first.shape[1], first.shape[0])
    if fitted is not camera:
        remarks += (f"{camera.name}: the calibration is scaled to {fitted.width} pixels width",)
    masks: MaskSource | None = None
    if choice.masks:
        masks = masks_in_folder(choice.masks / video.stem, frames)
    bodies = BodyRegions(choice.bodies, fitted) if choice.bodies else None
    plate = clip_plate(frames, masks, bodies, choice.plate, learned)
    masks = masks or DifferenceMasks(frames, plate, choice.plate.threshold, bodies)
    return DatasetCamera(fitted, frames, masks, plate), remarks
