"""People-Snapshot (Alldieck et al. 2018): one person who turns in front of a fixed camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.capture.frame_source import VideoFrames
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets import snapshot_files as files
from mocoflow_core.datasets.chosen_frames import WHITE, ChosenFrames, FramesOnWhite
from mocoflow_core.datasets.dataset_scene import (
    DatasetCamera,
    DatasetMeshes,
    DatasetScene,
    MaskSource,
)
from mocoflow_core.datasets.hdf5_masks import Hdf5Masks
from mocoflow_core.datasets.mask_sources import ChosenMasks, ErodedMasks
from mocoflow_core.datasets.pose_alignment import PoseAlignment, align_poses
from mocoflow_core.datasets.sampled_masks import sample_masks
from mocoflow_core.datasets.snapshot_bodies import BodyShape, SnapshotGender, open_bodies
from mocoflow_core.datasets.snapshot_clips import choose_clip
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.video import DecodedVideo, decode_to_the_end

Indices = NDArray[np.int32]
CAMERA = "camera"
NO_MOTION = 1e-4  # Distributed cameras have zeros.
LICENSE = "People-Snapshot: non-commercial research only, on request; no redistribution."
ATTRIBUTION = (
    "People-Snapshot; T. Alldieck, M. Magnor, W. Xu, C. Theobalt, G. Pons-Moll: Video Based "
    "Reconstruction of 3D People Models, CVPR 2018."
)


class PeopleSnapshotConfig(ConfigurationPart):
    """How a subject is read; the defaults are MoCo-Flow's protocol (sec. 4)."""

    body_model: Path | None = Field(
        None, description="SMPL file of the subject's gender, or a folder that holds it."
    )
    gender: SnapshotGender = Field("by name", description="By name: that of the folder.")
    first_frame: int | None = Field(
        None, ge=0, description="Source number; null: that of Neural Body's clip, else 0."
    )
    frames: int | None = Field(
        None, ge=1, description="Source frames; null: those of Neural Body's clip, else all."
    )
    stride: int = Field(
        2, ge=1, description="Every n-th frame is learned from: 24 to 12 per second in the paper."
    )
    background: Literal["white", "filmed"] = Field(
        "white", description="White: pixels outside the masks are, as in the paper."
    )
    mask_erosion_px: int = Field(
        0, ge=0, le=64, description="Side of the square that masks shrink by; Neural Body: 4."
    )
    bodies: Literal["posed", "none"] = Field(
        "posed", description="None: without a body model; meshes are given with --meshes later."
    )
    body_shape: BodyShape = Field(
        "clothed",
        description="Clothed: consensus shape and offsets; consensus: its shape alone; tracking: "
        "the shape of reconstructed_poses.hdf5.",
    )
    pose_alignment: PoseAlignment = Field(
        "auto",
        description="Where poses are more than frames: the first belong together (start), the "
        "last (end), or what agrees better with the masks (auto).",
    )
    most_surplus: int = Field(
        1, ge=0, description="By how many frames, masks and poses may differ in number."
    )


def read_people_snapshot(
    folder: Path,
    configuration: PeopleSnapshotConfig = PeopleSnapshotConfig(),  # noqa: B008 - frozen.
) -> DatasetScene:
    """Read one subject's folder, such as ``female-3-casual``.

    The video is decoded once to count its frames; masks and frames are read when written.

    Raises InputError for missing or damaged files, sizes that disagree with ``camera.pkl``, counts
    that differ by more than ``most_surplus``, and a missing body model.
    """
    subject = folder.resolve().name
    paths = files.find_paths(folder)
    camera, moved = _as_world(files.read_camera(paths.camera, CAMERA))
    video = decode_to_the_end(paths.video)
    _require_size(video.width, video.height, camera, paths.video.name)
    masks = Hdf5Masks(paths.masks)
    _require_size(masks.shape[2], masks.shape[1], camera, files.MASKS_FILE)
    tracked = files.read_tracked_body(paths.poses)
    usable, remarks = _usable(video, masks, len(tracked.pose), paths, configuration)
    numbers, origin = choose_clip(subject, configuration.first_frame, configuration.frames, usable)
    remarks += [origin, *moved]
    shrunk: MaskSource = masks
    if configuration.mask_erosion_px > 1:
        shrunk = ErodedMasks(masks, configuration.mask_erosion_px)
        remarks.append(f"masks are eroded by {configuration.mask_erosion_px} px")
    meshes = None
    if configuration.bodies == "posed":
        numbers, meshes, said = _meshes(
            subject, paths, tracked, camera, masks, numbers, configuration
        )
        remarks += said
    else:
        remarks.append("bodies are left out: give an estimate with --meshes")
    source = VideoFrames(paths.video)
    fps = _rate(source)
    recorded = _recorded(camera, source, ChosenMasks(shrunk, numbers), numbers, configuration)
    remarks.append(
        f"one frame in {configuration.stride} is learned from: {fps:g} / {configuration.stride} = "
        f"{fps / configuration.stride:g} per second; frames between may be held out"
    )
    return DatasetScene(
        name=subject,
        fps=fps,
        up="-y",
        train_camera=CAMERA,
        cameras={CAMERA: recorded},
        meshes=meshes,
        truth=None,
        license=LICENSE,
        attribution=ATTRIBUTION,
        remarks=tuple(remarks),
        working_fps=fps / configuration.stride,
    )


def _require_size(width: int, height: int, camera: Camera, what: str) -> None:
    if (width, height) == (camera.width, camera.height):
        return
    raise InputError(
        f"{what} must be {camera.width} x {camera.height} as {files.CAMERA_FILE} says",
        f"{width} x {height}",
        "It was turned, cropped or resized since: undo that, for example with ffmpeg's filters "
        "transpose and crop.",
    )


def _usable(
    video: DecodedVideo,
    masks: Hdf5Masks,
    poses: int,
    paths: files.SnapshotPaths,
    configuration: PeopleSnapshotConfig,
) -> tuple[int, list[str]]:
    """How many frames have a mask, counted from the first; and a remark on all the counts."""
    counts = {"frames": video.frame_count, "masks": masks.shape[0], "poses": poses}
    usable = min(video.frame_count, masks.shape[0])
    said = ", ".join(f"{count} {what}" for what, count in counts.items())
    if max(counts.values()) - min(counts.values()) > configuration.most_surplus:
        raise InputError(
            f"as many frames, masks and poses, up to {configuration.most_surplus}",
            said,
            "Take the files as they were distributed, or allow more with most_surplus.",
        )
    if paths.keypoints:
        said += f", {files.count_keypoints(paths.keypoints)} keypoints (not used)"
    remarks = [said]
    if video.frame_count != masks.shape[0]:
        remarks.append(f"frames and masks are joined from the first: {usable} are used")
    return usable, remarks


def _as_world(camera: Camera) -> tuple[Camera, list[str]]:
    """The camera as the world: poses stand in its axes, whatever the file says of it."""
    apart = max(float(np.abs(camera.R - np.eye(3)).max()), float(np.abs(camera.t).max()))
    remarks = [] if apart < NO_MOTION else ["camera_rt and camera_t are set to 0: poses have them"]
    return replace(camera, R=np.eye(3), t=np.zeros(3)), remarks


def _meshes(
    subject: str,
    paths: files.SnapshotPaths,
    tracked: files.TrackedBody,
    camera: Camera,
    masks: Hdf5Masks,
    numbers: Indices,
    configuration: PeopleSnapshotConfig,
) -> tuple[Indices, DatasetMeshes, list[str]]:
    """The frames that have a pose, their bodies, and remarks."""
    consensus = files.read_consensus_body(paths.consensus) if paths.consensus else None
    bodies, remarks = open_bodies(
        subject,
        tracked,
        consensus,
        configuration.body_model,
        configuration.gender,
        configuration.body_shape,
    )
    surplus = len(tracked.pose) - masks.shape[0]
    sampled = sample_masks(camera, masks, numbers)
    aligned = align_poses(configuration.pose_alignment, surplus, sampled, bodies.pose)
    remarks.append(aligned.remark)
    rows = numbers + np.int32(aligned.shift)
    posed = (rows >= 0) & (rows < len(tracked.pose))
    if not posed.all():
        remarks.append(f"{(~posed).sum()} frames at the end have no pose and are left out")
    sequence = replace(bodies.pose(rows[posed]), frame_indices=numbers[posed])
    source = f"People-Snapshot reconstructed poses, {configuration.body_shape} shape"
    return numbers[posed], DatasetMeshes(sequence, "world", True, source), remarks


def _rate(source: VideoFrames) -> float:
    """Frames per second as the container says."""
    fps = source.fps
    if not fps:
        raise InputError(
            "a video that states its rate",
            "none",
            "Write it again with its rate, for example with ffmpeg -r 24.",
        )
    return fps


def _recorded(
    camera: Camera,
    source: VideoFrames,
    masks: MaskSource,
    numbers: Indices,
    configuration: PeopleSnapshotConfig,
) -> DatasetCamera:
    frames = ChosenFrames(source, numbers)
    if configuration.background == "filmed":
        return DatasetCamera(camera, frames, masks)
    plate = np.full((camera.height, camera.width, 3), WHITE, np.uint8)
    return DatasetCamera(camera, FramesOnWhite(frames, masks), masks, plate)
