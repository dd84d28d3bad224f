"""From a scene's files to clips at the working size and rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.capture.background import background_plate, masks_from_plate
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.frame_selection import (
    FrameSelection,
    require_contiguous,
    select_frames,
)
from mocoflow_core.capture.frame_source import read_image, read_mask
from mocoflow_core.capture.repeated_frames import repeated_frames
from mocoflow_core.capture.scene import Scene
from mocoflow_core.capture.undistort import WorkingView
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError

Indices = NDArray[np.int32]
Masks = NDArray[np.bool_]


class CaptureConfig(ConfigurationPart):
    """How frames are taken from the files."""

    train_camera: str | None = Field(
        None, description="Camera to learn from; null: the one that scene.json names."
    )
    fps: float | None = Field(
        None, gt=0, description="Working rate; null: the scene's, by default the paper's 12."
    )
    max_side: int = Field(512, ge=16, description="Longer side of working frames, pixels.")
    held_out_frames: int = Field(
        8, ge=0, description="Source frames between working frames that are kept for scoring."
    )
    holdout_every: int = Field(
        0, ge=0, description="Keep every n-th working frame for scoring where none lies between."
    )
    least_shown: float = Field(
        0.0,
        ge=0,
        le=1,
        description="Frames that show less of the surface that faces the camera in the first "
        "frame are not looked at (the paper's partial observation); 0: all are.",
    )
    background_margin: float = Field(
        0.015, ge=0, le=0.2, description="Growth of masks for the plate, share of the longer side."
    )
    background_frames: int = Field(
        48, ge=1, description="At most so many frames make the plate, spread over the clip."
    )
    difference_threshold: int = Field(
        30, ge=1, le=255, description="Difference to the plate that counts as the person, 1/255."
    )


class ClipNeeds(ConfigurationPart):
    """What is made instead of taken from the files; the inspection decides."""

    background: bool = Field(False, description="The plate is made, also where one is given.")
    masks: bool = Field(False, description="So are the masks, by their difference to the plate.")
    repeated_frames: bool = Field(False, description="Frames that repeat another are kept.")


AS_FILES_SAY = ClipNeeds()


def extract_clip(
    scene: Scene,
    configuration: CaptureConfig,
    needs: ClipNeeds = AS_FILES_SAY,
    only: Indices | None = None,
) -> Clip:
    """The train camera's clip. No other camera and no truth is looked at.

    Args:
        only: source numbers beside which no frame is looked at.

    Raises InputError when frames or masks are missing, when sizes disagree, and when there are
    neither masks nor a background plate.
    """
    selection = select_training_frames(scene, configuration, only)
    clip = extract_camera(scene, scene.train_camera, selection, configuration, needs)
    if not needs.repeated_frames:
        clip = clip.at_rows(~repeated_frames(clip.frames, clip.masks, ~clip.held_out))
    if not clip.masks.any():
        raise InputError(
            f"{scene.train_camera} must show the person in a mask",
            "empty masks only",
            "Check the masks; the person is white.",
        )
    return clip


def extract_evaluation(
    scene: Scene,
    frame_indices: Indices,
    configuration: CaptureConfig,
    only: Indices | None = None,
) -> list[Clip]:
    """The other cameras' clips: those of the given frames that have a mask to score against.

    Only those among ``only``, where it is given. A camera without any such frame is left out. All
    frames count as held out.
    """
    clips = []
    if only is not None:
        frame_indices = np.intersect1d(frame_indices, only).astype(np.int32)
    for name in scene.evaluation_cameras:
        masked = np.array(sorted(scene.masks(name)), np.int32)
        scored = np.intersect1d(np.intersect1d(frame_indices, masked), scene.frames(name).indices)
        if len(scored):
            selection = FrameSelection(scored[:0], scored, scene.description.fps)
            clips.append(extract_camera(scene, name, selection, configuration))
    return clips


def select_training_frames(
    scene: Scene, configuration: CaptureConfig, only: Indices | None = None
) -> FrameSelection:
    """The train camera's working and held-out frames, checked to be there with their masks.

    ``only``: source numbers beside which none is selected.
    """
    name = scene.train_camera
    available = scene.frames(name).indices
    require_contiguous(available, f"frames of {name}")
    masks = scene.masks(name)
    if not masks and scene.background(name) is None:
        raise InputError(
            f"{name} must have masks or a background plate",
            "neither",
            "Add a mask for each frame, or a picture of the background without the person.",
        )
    selection = select_frames(
        available,
        scene.description.fps,
        configuration.fps or scene.description.working_fps,
        np.array(sorted(masks), np.int32) if masks else available,
        configuration.held_out_frames,
        configuration.holdout_every,
    )
    unmasked = np.setdiff1d(selection.working, list(masks))
    if masks and len(unmasked):
        raise InputError(
            f"{name} must have a mask for each frame",
            f"none for frame {unmasked[0]} ({len(unmasked)} missing)",
            "Add the masks, all black where the person is out of sight.",
        )
    return selection if only is None else selection.among(only)


def extract_camera(
    scene: Scene,
    name: str,
    selection: FrameSelection,
    configuration: CaptureConfig,
    needs: ClipNeeds = AS_FILES_SAY,
) -> Clip:
    """The selected frames of any camera, with their masks and what is behind the person."""
    indices = selection.all
    view = WorkingView.of(scene.cameras[name], configuration.max_side)
    frames = _frames(scene, name, indices, view)
    held_out = np.isin(indices, selection.held_out)
    plate, mask_files = _given_plate(scene, name, view), scene.masks(name)
    # Held-out frames must not be trained on, and the plate is part of the training.
    usable = np.flatnonzero(~held_out) if len(selection.working) else np.arange(len(indices))
    if mask_files:
        masks = _masks(mask_files, indices, view)
    else:
        assert plate is not None
        masks = masks_from_plate(frames, plate, configuration.difference_threshold)
    if plate is None or needs.background:
        plate = _plate(frames, masks, usable, configuration)
    if needs.masks:
        masks = masks_from_plate(frames, plate, configuration.difference_threshold)
    return Clip(
        camera=view.camera,
        fps=selection.fps,
        frame_indices=indices,
        frames=frames,
        masks=masks,
        has_mask=np.ones(len(indices), bool),
        held_out=held_out,
        background=plate,
    )


def _frames(scene: Scene, name: str, indices: Indices, view: WorkingView) -> NDArray[np.uint8]:
    frames = np.empty((len(indices), view.camera.height, view.camera.width, 3), np.uint8)
    for row, (number, picture) in enumerate(scene.frames(name).read(indices.tolist())):
        _require_size(picture, view, f"frame {number} of {name}")
        frames[row] = view.image(picture)
    return frames


def _masks(files: dict[int, Path], indices: Indices, view: WorkingView) -> Masks:
    masks = np.empty((len(indices), view.camera.height, view.camera.width), bool)
    for row, index in enumerate(indices.tolist()):
        picture = read_mask(files[index])
        _require_size(picture, view, f"mask {files[index].name} of {view.camera.name}")
        masks[row] = view.mask(picture)
    return masks


def _given_plate(scene: Scene, name: str, view: WorkingView) -> NDArray[np.uint8] | None:
    file = scene.background(name)
    if file is None:
        return None
    picture = read_image(file)
    _require_size(picture, view, f"background of {name}")
    return view.image(picture)


def _plate(
    frames: NDArray[np.uint8],
    masks: Masks,
    usable: NDArray[np.intp],
    configuration: CaptureConfig,
) -> NDArray[np.uint8]:
    count = min(len(usable), configuration.background_frames)
    chosen = usable[np.linspace(0, len(usable) - 1, count).round().astype(int)]
    margin_px = round(configuration.background_margin * max(frames.shape[1:3]))
    return background_plate(frames[chosen], masks[chosen], margin_px)


def _require_size(picture: NDArray[np.uint8], view: WorkingView, what: str) -> None:
    height, width = picture.shape[:2]
    if (width, height) != (view.source.width, view.source.height):
        raise InputError(
            f"{what} must be {view.source.width} x {view.source.height} as scene.json says",
            f"{width} x {height}",
            "Give the picture that size, or correct width, height and K together.",
        )
