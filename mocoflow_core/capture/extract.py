"""From a scene's files to clips at the working size and rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.capture.background import (
    background_plate,
    covered_share,
    masks_from_plate,
    plate_without_masks,
)
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.composite import composite_clip
from mocoflow_core.capture.frame_selection import (
    FrameSelection,
    require_contiguous,
    select_frames,
)
from mocoflow_core.capture.repeated_frames import repeated_frames
from mocoflow_core.capture.scene import Scene
from mocoflow_core.capture.scene_description import BehindPerson
from mocoflow_core.capture.undistort import WorkingView
from mocoflow_core.capture.working_pictures import working_frames, working_masks, working_plate
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.progress import Progress, part_of, untold

Indices = NDArray[np.int32]
Masks = NDArray[np.bool_]

# About the shares of the time after which a camera's clip is there, before it is composited; and
# of that, after which the train camera's is there with all its frames; and of a clip, after which
# its frames are there, its masks, and the plate that is made from both.
EXTRACTING = 0.7
COMPARING = 0.8
DECODING, MASKING, PLATING = 0.6, 0.8, 0.9


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
    behind_person: BehindPerson | None = Field(
        None,
        description="What the frames show around the person: what the camera saw (kept), the "
        "background plate, which removes cast shadows (the paper for AIST), or white (for "
        "People-Snapshot); null: what scene.json says, by default kept.",
    )

    def behind(self, scene: Scene) -> BehindPerson:
        """What is behind the person: as chosen, or as the scene says."""
        return self.behind_person or scene.description.behind_person


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
    progress: Progress = untold,
) -> Clip:
    """The train camera's clip as the camera saw it. No other camera and no truth is looked at.

    ``configuration.behind_person`` is left to ``composite_clip``: frames are judged by what is
    behind the person before it is replaced.

    Args:
        only: source numbers beside which no frame is looked at.

    Raises InputError when frames or masks are missing, and when sizes disagree.
    """
    selection = select_training_frames(scene, configuration, only)
    extracting, comparing = part_of(progress, 0.0, COMPARING), part_of(progress, COMPARING, 1.0)
    clip = extract_camera(scene, scene.train_camera, selection, configuration, needs, extracting)
    if not needs.repeated_frames:
        repeated = repeated_frames(clip.frames, clip.masks, ~clip.held_out, comparing)
        clip = clip.at_rows(~repeated)
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
    progress: Progress = untold,
) -> list[Clip]:
    """The other cameras' clips: those of the given frames that have a mask to score against.

    Only those among ``only``, where it is given. A camera without any such frame is left out. All
    frames count as held out. What is behind the person is replaced as in the train camera.
    """
    clips = []
    if only is not None:
        frame_indices = np.intersect1d(frame_indices, only).astype(np.int32)
    for number, name in enumerate(scene.evaluation_cameras):
        cameras = len(scene.evaluation_cameras)
        told = part_of(progress, number / cameras, (number + 1) / cameras)
        masked = np.array(sorted(scene.masks(name)), np.int32)
        scored = np.intersect1d(np.intersect1d(frame_indices, masked), scene.frames(name).indices)
        if len(scored):
            selection = FrameSelection(scored[:0], scored, scene.description.fps)
            seen = extract_camera(
                scene, name, selection, configuration, progress=part_of(told, 0.0, EXTRACTING)
            )
            behind, composing = configuration.behind(scene), part_of(told, EXTRACTING, 1.0)
            clips.append(composite_clip(scene, seen, behind, scene.masks(name), composing))
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
    progress: Progress = untold,
) -> Clip:
    """The selected frames of any camera, with their masks and what is behind the person."""
    indices = selection.all
    view = WorkingView.of(scene.cameras[name], configuration.max_side)
    frames = working_frames(scene, name, indices, view, part_of(progress, 0.0, DECODING))
    held_out = np.isin(indices, selection.held_out)
    plate, mask_files = working_plate(scene, name, view), scene.masks(name)
    # Held-out frames must not be trained on, and the plate is part of the training.
    usable = np.flatnonzero(~held_out) if len(selection.working) else np.arange(len(indices))
    remarks = []
    threshold = configuration.difference_threshold
    masking, plating = part_of(progress, DECODING, MASKING), part_of(progress, MASKING, PLATING)
    if mask_files:
        masks = working_masks(mask_files, indices, view, masking)
    else:
        if plate is None:
            plate, _ = _plate(frames, None, usable, configuration, part_of(masking, 0.0, 0.5))
            remarks.append(
                f"{name} has neither masks nor a background picture: the person is what differs "
                "from the median of its frames, shadows with it"
            )
        masks = masks_from_plate(frames, plate, threshold, part_of(masking, 0.5, 1.0))
    if plate is None or needs.background:
        plate, guessed = _plate(frames, masks, usable, configuration, plating)
        if guessed and configuration.behind(scene) != "white":
            remarks.append(
                f"the person covers {100 * guessed:.2g} % of the picture of {name} in every "
                "frame: the background there is filled from around"
            )
    if needs.masks:
        masks = masks_from_plate(frames, plate, threshold, part_of(progress, PLATING, 1.0))
    return Clip(
        camera=view.camera,
        fps=selection.fps,
        frame_indices=indices,
        frames=frames,
        masks=masks,
        has_mask=np.ones(len(indices), bool),
        held_out=held_out,
        background=plate,
        remarks=tuple(remarks),
    )


def _plate(
    frames: NDArray[np.uint8],
    masks: Masks | None,
    usable: NDArray[np.intp],
    configuration: CaptureConfig,
    progress: Progress,
) -> tuple[NDArray[np.uint8], float]:
    """The plate of some frames, and the share of it that none of them shows."""
    count = min(len(usable), configuration.background_frames)
    chosen = usable[np.linspace(0, len(usable) - 1, count).round().astype(int)]
    margin_px = round(configuration.background_margin * max(frames.shape[1:3]))
    if masks is None:
        threshold = configuration.difference_threshold
        return plate_without_masks(frames[chosen], threshold, margin_px, progress), 0.0
    plate = background_plate(frames[chosen], masks[chosen], margin_px, progress)
    return plate, covered_share(masks[chosen])
