"""People-Snapshot (Alldieck et al. 2018): one person who turns in front of a fixed camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.capture.frame_source import VideoFrames
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.chosen import Chosen
from mocoflow_core.datasets.dataset_scene import (
    DatasetCamera,
    DatasetMeshes,
    DatasetScene,
)
from mocoflow_core.datasets.hdf5_masks import Hdf5Masks
from mocoflow_core.datasets.links import LINKS, Links, require_inside
from mocoflow_core.datasets.mask_sources import ErodedMasks
from mocoflow_core.datasets.picture_size import require_size
from mocoflow_core.datasets.pose_alignment import PoseAlignment, align_poses
from mocoflow_core.datasets.sampled_masks import sample_masks
from mocoflow_core.datasets.snapshot_bodies import BodyShape, SnapshotGender, open_bodies
from mocoflow_core.datasets.snapshot_clips import choose_clip
from mocoflow_core.datasets.snapshot_files import (
    SnapshotPaths,
    TrackedBody,
    count_keypoints,
    find_paths,
    read_camera,
    read_consensus_body,
    read_tracked_body,
)
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.video import decode_to_the_end

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
        "white",
        description="White: what a reconstruction sets the person before, as in the paper; the "
        "scene's frames are as filmed.",
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
    links: Links = Field("inside", description=LINKS)


def read_people_snapshot(
    folder: Path,
    configuration: PeopleSnapshotConfig = PeopleSnapshotConfig(),  # noqa: B008 - frozen.
) -> DatasetScene:
    """Read one subject's folder, such as ``female-3-casual``.

    The video is decoded once to count its frames; masks and frames are read when written.

    Raises InputError for missing and damaged files, links that lead out of the folder, sizes that
    disagree with ``camera.pkl``, counts that differ by more than ``most_surplus``, and a missing
    body model.
    """
    paths = find_paths(folder)
    require_inside(folder, paths.present, configuration.links)
    subject = _open(folder, paths)
    usable, remarks = _usable(subject, configuration.most_surplus)
    numbers, origin = choose_clip(
        subject.name, configuration.first_frame, configuration.frames, usable
    )
    remarks += [origin, *subject.remarks]
    meshes = None
    if configuration.bodies == "posed":
        meshes, said = _posed(subject, numbers, configuration)
        numbers = meshes.sequence.frame_indices
        remarks += said
    else:
        remarks.append("bodies are left out: give an estimate with --meshes")
    fps, working_fps, rate = _rates(subject, configuration.stride)
    return DatasetScene(
        name=subject.name,
        fps=fps,
        up="-y",
        train_camera=CAMERA,
        cameras={CAMERA: _recorded(subject, numbers, configuration)},
        meshes=meshes,
        truth=None,
        license=LICENSE,
        attribution=ATTRIBUTION,
        remarks=(*remarks, rate),
        behind_person="white" if configuration.background == "white" else "kept",
        working_fps=working_fps,
    )


@dataclass(frozen=True, eq=False)
class _Subject:
    """One subject's files, opened and found to belong together."""

    name: str
    paths: SnapshotPaths
    camera: Camera  # the world is its axes
    frame_count: int  # as decoded
    masks: Hdf5Masks
    tracked: TrackedBody
    remarks: tuple[str, ...]


def _open(folder: Path, paths: SnapshotPaths) -> _Subject:
    camera, remarks = _as_world(read_camera(paths.camera, CAMERA))
    video = decode_to_the_end(paths.video)
    require_size((video.width, video.height), camera.size, paths.video.name)
    masks = Hdf5Masks(paths.masks)
    require_size(masks.shape[:0:-1], camera.size, paths.masks.name)
    tracked = read_tracked_body(paths.poses)
    name = folder.resolve().name
    return _Subject(name, paths, camera, video.frame_count, masks, tracked, remarks)


def _as_world(camera: Camera) -> tuple[Camera, tuple[str, ...]]:
    """The camera as the world: poses stand in its axes, whatever the file says of it."""
    apart = max(float(np.abs(camera.R - np.eye(3)).max()), float(np.abs(camera.t).max()))
    moved = ("camera_rt and camera_t are set to 0: poses have them",) if apart > NO_MOTION else ()
    return replace(camera, R=np.eye(3), t=np.zeros(3)), moved


def _usable(subject: _Subject, most_surplus: int) -> tuple[int, list[str]]:
    """How many frames have a mask, counted from the first; and remarks on all the counts."""
    frames, masks, poses = subject.frame_count, subject.masks.shape[0], len(subject.tracked.pose)
    said = f"{frames} frames, {masks} masks, {poses} poses"
    if max(frames, masks, poses) - min(frames, masks, poses) > most_surplus:
        raise InputError(
            f"as many frames, masks and poses, up to {most_surplus}",
            said,
            "Take the files as they were distributed, or allow more with most_surplus.",
        )
    if subject.paths.keypoints:
        said += f", {count_keypoints(subject.paths.keypoints)} keypoints (not used)"
    usable = min(frames, masks)
    joined = f"frames and masks are joined from the first: {usable} are used"
    return usable, [said] if frames == masks else [said, joined]


def _posed(
    subject: _Subject, numbers: Indices, configuration: PeopleSnapshotConfig
) -> tuple[DatasetMeshes, list[str]]:
    """The bodies of those frames that have a pose, and remarks."""
    consensus, poses = subject.paths.consensus, len(subject.tracked.pose)
    bodies, remarks = open_bodies(
        subject.name,
        subject.tracked,
        read_consensus_body(consensus) if consensus else None,
        configuration.body_model,
        configuration.gender,
        configuration.body_shape,
    )
    surplus = poses - subject.masks.shape[0]
    sampled = sample_masks(subject.camera, subject.masks, numbers)
    aligned = align_poses(configuration.pose_alignment, surplus, sampled, bodies.pose)
    remarks.append(aligned.remark)
    rows = numbers + np.int32(aligned.shift)
    there = (rows >= 0) & (rows < poses)
    if not there.all():
        remarks.append(f"{(~there).sum()} frames at the end have no pose and are left out")
    sequence = replace(bodies.pose(rows[there]), frame_indices=numbers[there])
    source = f"People-Snapshot reconstructed poses, {configuration.body_shape} shape"
    return DatasetMeshes(sequence, "world", True, source), remarks


def _rates(subject: _Subject, stride: int) -> tuple[float, float, str]:
    """Frames per second as the container says, those to learn from, and a remark."""
    fps = VideoFrames(subject.paths.video).fps
    if not fps:
        raise InputError(
            "a video that states its rate",
            "none",
            "Write it again with its rate, for example with ffmpeg -r 24.",
        )
    return (
        fps,
        fps / stride,
        f"one frame in {stride} is learned from: {fps:g} / {stride} = {fps / stride:g} per "
        "second; frames between may be held out",
    )


def _recorded(
    subject: _Subject, numbers: Indices, configuration: PeopleSnapshotConfig
) -> DatasetCamera:
    camera, side_px = subject.camera, configuration.mask_erosion_px
    masks = ErodedMasks(subject.masks, side_px) if side_px else subject.masks
    video = VideoFrames(subject.paths.video)
    return DatasetCamera(camera, Chosen(video, numbers, fps=video.fps), Chosen(masks, numbers))
