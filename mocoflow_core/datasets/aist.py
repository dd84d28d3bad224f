"""AIST Dance Video DB with the annotations of AIST++: one dancer, nine calibrated cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.scene import UP_VECTORS
from mocoflow_core.datasets.aist_bodies import posed_motion
from mocoflow_core.datasets.aist_cameras import read_cameras
from mocoflow_core.datasets.aist_configuration import AistConfig
from mocoflow_core.datasets.aist_files import AistFiles, find_files
from mocoflow_core.datasets.aist_keypoints import keypoint_truth
from mocoflow_core.datasets.aist_masks import PlateChoice
from mocoflow_core.datasets.aist_names import read_ignore_list, require_annotated
from mocoflow_core.datasets.aist_time import GRID_FPS
from mocoflow_core.datasets.aist_views import (
    ViewChoice,
    available_ticks,
    open_view,
    present_views,
    train_view,
)
from mocoflow_core.datasets.camera_up import up_of_cameras
from mocoflow_core.datasets.caveats import of_masks_near, of_multi_view_bodies
from mocoflow_core.datasets.dataset_scene import DatasetCamera, DatasetMeshes, DatasetScene, Up
from mocoflow_core.datasets.links import require_inside
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.aist_motion import METRES, Motion, read_motion
from mocoflow_core.geometry.camera import Camera

Indices = NDArray[np.int32]
EXPECTED_UP: Up = "+y"
LICENSE = (
    "annotations CC BY 4.0 (Google LLC); videos under the terms of the AIST Dance Video Database: "
    "academic use, not to be passed on"
)
ATTRIBUTION = (
    "AIST Dance Video Database (Tsuchida et al., ISMIR 2019); AIST++ (Li et al., ICCV 2021)"
)
NO_MASKS = "AIST comes without masks: the person is what differs from the clip's median background"
NEAR_BODIES = (
    ", near the bodies of its motion, well inside them in any colour, and beside them without what "
    "looks like a shadow"
)
WITH_SHADOWS = ", shadows with it"
# Videos and annotations may differ by a frame without anything being wrong.
FRAME_TOLERANCE = 1


def read_aist(
    source: Path,
    configuration: AistConfig = AistConfig(),  # noqa: B008 - frozen.
) -> DatasetScene:
    """One sequence as a scene; ``source`` is a folder of videos and annotations, or one video.

    Frame numbers count the 60 Hz grid of the annotations. The videos are looked at for their
    plates; frames are read when written.

    Raises InputError for links that lead out of a folder, and for names, cameras, videos, motions
    or body models that are wrong or missing.
    """
    files = find_files(
        source, configuration.sequence, configuration.videos, configuration.annotations
    )
    require_annotated(files.name)
    require_inside(files.videos, files.recordings, configuration.links)
    require_inside(files.annotations, files.annotated, configuration.links)
    ignored = _ignored(files, configuration)
    motion = read_motion(files.motion) if files.motion.is_file() else None
    unit_m, unit_remark = _unit(motion, configuration)
    calibrated = read_cameras(files.cameras, files.name.sequence, unit_m)
    present, view_remarks = present_views(files, calibrated, configuration.left_out_views)
    train = train_view(configuration.train_camera, present)
    clip, clip_remarks = _clip(files, train, motion, configuration)
    meshes, body_remarks = _meshes(files, motion, clip, unit_m, configuration)
    choice = _view_choice(meshes, configuration)
    others = [name for name in present if name in (configuration.evaluation_cameras or present)]
    cameras, camera_remarks = _cameras(
        files, calibrated, [train, *others], clip, configuration.stride, choice
    )
    truth, truth_remarks = keypoint_truth(files.keypoints, clip, unit_m)
    up, up_remarks = _up(calibrated, configuration)
    remarks = (*ignored, unit_remark, *view_remarks, *clip_remarks, *camera_remarks)
    return DatasetScene(
        name=files.name.sequence,
        fps=GRID_FPS,
        up=up,
        train_camera=train,
        cameras=cameras,
        meshes=meshes,
        truth=truth,
        license=LICENSE,
        attribution=ATTRIBUTION,
        remarks=(*remarks, *body_remarks, *truth_remarks, *up_remarks, *_floor(meshes, up)),
        behind_person="plate" if configuration.background == "plate" else "kept",
        caveats=(
            *of_multi_view_bodies(meshes),
            *(() if configuration.masks else of_masks_near(meshes)),
        ),
        working_fps=GRID_FPS / configuration.stride,
    )


def _ignored(files: AistFiles, configuration: AistConfig) -> tuple[str, ...]:
    """A remark for a sequence on the ignore list, or one that there is no list.

    Raises InputError for a sequence on the list, unless it is wanted nevertheless.
    """
    if not files.ignore_list.is_file():
        return (
            f"no {files.ignore_list.name}: whether the annotations are known to be wrong "
            "is not known",
        )
    sequence = files.name.sequence
    if sequence not in read_ignore_list(files.ignore_list):
        return ()
    if configuration.ignore_list == "warn":
        return (
            f"{sequence} is on {files.ignore_list.name}: its annotations are known to be wrong",
        )
    raise InputError(
        "a sequence whose annotations are right",
        f"{sequence}, which is on {files.ignore_list.name}",
        "Choose another, or set ignore_list to warn.",
    )


def _unit(motion: Motion | None, configuration: AistConfig) -> tuple[float, str]:
    """Metres of a unit of the data set's world, and how that was chosen."""
    if configuration.scale == "centimetres":
        return METRES, "the world's unit is a centimetre, as the cameras were calibrated"
    if motion is None or motion.scaling <= 0:
        raise InputError(
            "the motion of the sequence, whose scale makes metres",
            "none",
            "Add motions/, or set scale to centimetres.",
        )
    remark = (
        f"the world is divided by the scaling {motion.scaling:.2f} of this sequence's body: "
        "lengths are those of a body of SMPL's size"
    )
    return 1 / motion.scaling, remark


def _clip(
    files: AistFiles, train: str, motion: Motion | None, configuration: AistConfig
) -> tuple[Indices, tuple[str, ...]]:
    """The ticks to use: asked for, filmed by the train camera, and with a motion if there is one.

    Raises InputError when there are none.
    """
    ticks, remarks = available_ticks(files.video(train), configuration.rounding)
    filmed = len(ticks)
    if motion is not None:
        if abs(filmed - len(motion)) > FRAME_TOLERANCE:
            remarks += (f"{train} has {filmed} frames, the motion {len(motion)}",)
        ticks = ticks[: len(motion)]
    start, length = configuration.first_frame, configuration.frames
    clip = ticks[(ticks >= start) & (ticks < start + length)]
    if not len(clip):
        raise InputError(
            f"frames {start} to {start + length - 1}",
            f"a recording of {len(ticks)} frames",
            "Choose others with first_frame and frames.",
        )
    if len(clip) < length:
        remarks += (f"the clip has {len(clip)} of {length} frames: the recording is shorter",)
    return clip, remarks


def _view_choice(meshes: DatasetMeshes | None, configuration: AistConfig) -> ViewChoice:
    return ViewChoice(
        configuration.rounding,
        configuration.masks,
        PlateChoice(configuration.plate_frames, configuration.difference_threshold),
        meshes.sequence if meshes else None,
    )


def _cameras(
    files: AistFiles,
    calibrated: dict[str, Camera],
    names: list[str],
    clip: Indices,
    stride: int,
    choice: ViewChoice,
) -> tuple[dict[str, DatasetCamera], tuple[str, ...]]:
    """The first, which trains, with the whole clip; the others with what is learned from."""
    cameras: dict[str, DatasetCamera] = {}
    made = NO_MASKS + (NEAR_BODIES if choice.bodies else WITH_SHADOWS)
    remarks = ["masks are the user's" if choice.masks else made]
    for name in dict.fromkeys(names):
        ticks = clip[::stride] if cameras else clip
        cameras[name], said = open_view(files, calibrated[name], ticks, clip[::stride], choice)
        remarks += said
    return cameras, tuple(remarks)


def _meshes(
    files: AistFiles,
    motion: Motion | None,
    clip: Indices,
    unit_m: float,
    configuration: AistConfig,
) -> tuple[DatasetMeshes | None, tuple[str, ...]]:
    if configuration.bodies == "none":
        return None, ("the motion is not used: give bodies with --meshes",)
    if motion is None:
        raise InputError(
            f"the motion motions/{files.motion.name}",
            "none",
            "Add it, or set bodies to none and give some with --meshes.",
        )
    return posed_motion(motion, clip, unit_m, configuration.body_model)


def _up(calibrated: dict[str, Camera], configuration: AistConfig) -> tuple[Up, tuple[str, ...]]:
    if configuration.up:
        return configuration.up, (f"up is {configuration.up}, as asked for",)
    up, remark = up_of_cameras((camera.R for camera in calibrated.values()), EXPECTED_UP)
    return up, (remark,)


def _floor(meshes: DatasetMeshes | None, up: Up) -> tuple[str, ...]:
    """Where the floor is: the calibration leaves it anywhere; feet stand on it most of the time."""
    if meshes is None:
        return ()
    lowest = (meshes.sequence.vertices @ UP_VECTORS[up]).min(axis=1)
    return (
        f"the floor is at {np.median(lowest):.2f} m along {up}, by the lowest points of bodies",
    )
