"""A bare video of one person, as a phone makes it: everything else is found in it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.fit.fit_body import FittedBody, fit_body
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.capture.frame_selection import select_frames
from mocoflow_core.capture.scene import UP_VECTORS
from mocoflow_core.datasets.dataset_scene import DatasetCamera, DatasetMeshes, DatasetScene, Up
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.video_facts import read_video_facts
from mocoflow_core.perception.blazepose import BlazePose
from mocoflow_core.perception.own_networks import own_segmenter
from mocoflow_core.progress import Progress
from mocoflow_core.video.camera_check import require_movement, require_still_camera
from mocoflow_core.video.clip_frames import ClipFrames, choose_frames
from mocoflow_core.video.configuration import VideoConfig
from mocoflow_core.video.followed_person import FollowedPerson, follow_person
from mocoflow_core.video.lens import camera_of_video
from mocoflow_core.video.person_masks import PackedMasks, make_plate, mask_person

CAMERA = "camera"
CAUTION = "caution: "
# People hold cameras upright; the world is the camera's axes.
UP: Up = "-y"
# The camera and movement are checked on so many frames.
CHECKED_FRAMES = 8
# Outlines need no finer masks than these.
FIT_SIDE = 640
LICENSE = "as the video's"


def missing_in_video(path: Path) -> list[str]:
    """What a path lacks to be a video file; whether it can be decoded shows when it is read."""
    return [] if path.is_file() else ["a video file"]


def read_bare_video(
    path: Path,
    configuration: VideoConfig = VideoConfig(),  # noqa: B008 - frozen.
    progress: Progress = lambda fraction, text: None,
) -> DatasetScene:
    """Follow one person through a clip of the video; masks, plate and camera are made.

    Raises InputError for no video, a clip too long or too short, nobody or several persons in it,
    somebody who leaves, a camera that moves, and a picture that stands still.
    """
    if not path.is_file():
        raise InputError("a video file", f"nothing at {path}", "Check the path.")
    own = configuration.segmenter
    segmenter = None if own is None else own_segmenter(own)
    facts = read_video_facts(path)
    frames, rate_said = choose_frames(path, facts, configuration)
    person = follow_person(
        *(frames, frames.rate, configuration.start_s, configuration.person),
        *(BlazePose(), progress),
    )
    frames = frames.part(person.first, person.last)
    working_fps = _working_fps(frames.rate, configuration.working_fps)
    usable = usable_frames(frames, working_fps)
    plate, pictures, covered = make_plate(
        frames, person, usable, frames.size, configuration.plate_frames
    )
    checked = np.unique(np.linspace(0, len(pictures) - 1, CHECKED_FRAMES).round().astype(int))
    require_movement(pictures[checked], covered[checked])
    _, motion_said = require_still_camera(pictures[checked], covered[checked])
    masks = mask_person(
        *(frames, frames.rate, person, usable, plate, configuration.least_difference),
        *(progress, segmenter),
    )
    camera, lens_said = camera_of_video(
        CAMERA, frames.video_size, frames.size, configuration.focal_px, facts.metadata
    )
    meshes = None
    fit_said: tuple[str, ...] = ("bodies are left out: give an estimate with --meshes",)
    if configuration.bodies == "fitted":
        fitted = _fit(person, masks, usable, camera, frames, configuration, progress)
        meshes = DatasetMeshes(fitted.meshes, "world", True, "fitted to landmarks and outlines")
        fit_said = _about(fitted)
    said = (
        rate_said,
        *_held_back(usable),
        *person.remarks,
        *_cut_off(person, frames),
        motion_said,
        *([f"masks by {segmenter.name} {segmenter.digest[:12]}"] if segmenter else []),
        lens_said,
        *fit_said,
    )
    return DatasetScene(
        name=path.stem,
        fps=frames.rate,
        up=UP,
        train_camera=CAMERA,
        cameras={CAMERA: DatasetCamera(camera, frames, masks, plate)},
        meshes=meshes,
        truth=None,
        license=LICENSE,
        attribution=path.name,
        remarks=tuple(line for line in said if not line.startswith(CAUTION)),
        caveats=tuple(line for line in said if line.startswith(CAUTION)),
        working_fps=working_fps,
    )


def usable_frames(frames: ClipFrames, working_fps: float) -> NDArray[np.bool_]:
    """Which frames (T,) no run at the working rate may hold out to score itself."""
    indices = frames.indices
    selection = select_frames(indices, frames.rate, working_fps, indices, len(indices), 0)
    return ~np.isin(indices, selection.held_out)


def _held_back(usable: NDArray[np.bool_]) -> tuple[str, ...]:
    if usable.all():
        return ()
    return (
        f"the background, the masks and the body are made from {usable.sum()} frames; "
        f"{(~usable).sum()} between them may be held out for scoring, and their bodies are bridged",
    )


def _working_fps(rate: float, wanted: float) -> float:
    """Near the wanted one, and a whole part of the rate: frames between can then be held out."""
    return rate / max(1, int(rate / wanted + 0.5))


def _fit(
    person: FollowedPerson,
    masks: PackedMasks,
    usable: NDArray[np.bool_],
    camera: Camera,
    frames: ClipFrames,
    configuration: VideoConfig,
    progress: Progress,
) -> FittedBody:
    width, height = frames.size
    shrink = min(1.0, FIT_SIDE / max(width, height))
    small = camera.resized(round(width * shrink), round(height * shrink))
    outlines = [
        cv2.resize(masks.at(row).astype(np.uint8) * 255, (small.width, small.height)) > 127
        for row in range(len(masks.packed))
    ]
    return fit_body(
        _sightings(person, (small.width / width, small.height / height)),
        np.stack(outlines),
        small,
        frames.rate,
        configuration.body,
        frames.indices,
        UP_VECTORS[UP],
        usable,
        progress,
    )


def _sightings(person: FollowedPerson, scale: tuple[float, float]) -> Sightings:
    landmarks = [pose.landmarks for pose in person.poses]
    places = np.stack([found.places for found in landmarks]) * np.array(scale)
    confidence = np.stack([found.visibility for found in landmarks]) * person.seen[:, None]
    return Sightings.of(places, confidence, np.stack([found.world for found in landmarks]))


def _about(fitted: FittedBody) -> tuple[str, ...]:
    """How well the body fits, and what it is."""
    readings = ", ".join(f"{name} {value:g}" for name, value in fitted.readings.items())
    overlap = _percentiles(fitted.silhouette_iou)
    return (
        f"a body was fitted: {readings}; unless given, its height is a usual one, and its distance "
        "depends on it",
        f"its outline overlaps the masks by {overlap}",
        *(f"caution: {warning}" for warning in fitted.warnings),
    )


def _percentiles(values: NDArray[np.floating]) -> str:
    low, middle = np.nanpercentile(values, (5, 50))
    return f"{middle:.2f} (worst twentieth: below {low:.2f})"


def _cut_off(person: FollowedPerson, frames: ClipFrames) -> tuple[str, ...]:
    """A word of caution where parts of the person lie outside the pictures."""
    places = np.stack([pose.keypoints.places for pose in person.poses])
    outside = ((places < 0) | (places >= np.array(frames.size))).any(-1)
    share = float(outside.mean())
    if share < 0.02:
        return ()
    return (f"caution: {100 * share:.0f} % of the body's keypoints lie outside the picture",)
