"""ZJU-MoCap as Neural Body released it: one person, 21 or 23 calibrated cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.camera_up import up_of_cameras
from mocoflow_core.datasets.caveats import of_multi_view_bodies
from mocoflow_core.datasets.dataset_scene import DatasetCamera, DatasetMeshes, DatasetScene, Up
from mocoflow_core.datasets.links import LINKS, Links, links_below, require_inside
from mocoflow_core.datasets.zju_annotations import LengthUnit, ZjuAnnotations, read_annotations
from mocoflow_core.datasets.zju_bodies import BodyChoice, BodySource, read_bodies
from mocoflow_core.datasets.zju_cameras import (
    choose_camera,
    open_camera,
    recorded_frames,
)
from mocoflow_core.datasets.zju_clips import bad_masks, chosen_range, subject_of, unbroken_clip
from mocoflow_core.datasets.zju_masks import MaskChoice

Indices = NDArray[np.int32]
# What real files of subjects 377 and 387 show.
EXPECTED_UP: Up = "-z"
LICENSE = "by signed agreement, non-commercial; not to be passed on"
ATTRIBUTION = "ZJU-MoCap (Peng et al., Neural Body, CVPR 2021)"


class ZjuMocapConfig(ConfigurationPart):
    """What is taken of a ZJU-MoCap subject; the defaults are the protocol of MoCo-Flow sec. 4."""

    train_camera: str | None = Field(
        None, description="Camera to learn from; null: B1, or (1) of 313 and 315."
    )
    evaluation_cameras: tuple[str, ...] | None = Field(
        None, description="Cameras to score against; null: all others."
    )
    first_frame: int | None = Field(
        None, ge=0, description="Source number; null: that of the subject's usual clip."
    )
    frames: int | None = Field(
        None, ge=1, description="Source frames; null: those of the subject's usual clip."
    )
    stride: int = Field(
        2,
        ge=1,
        description="Every n-th frame is learned from, and taken of the other cameras: 24 to 12 "
        "per second in the paper.",
    )
    fps: float = Field(
        24.0, gt=0, description="Rate that the source counts as; the true one is not known."
    )
    masks: MaskChoice = Field(
        "union", description="Folder of masks: mask, mask_cihp, or what either calls a person."
    )
    background: Literal["white", "filmed"] = Field(
        "white",
        description="White: what a reconstruction sets the person before; the scene's frames are "
        "as filmed.",
    )
    bodies: BodyChoice = Field("best", description="Folder of bodies; best: of most frames.")
    body_number_offset: int = Field(0, description="Number of a body file less its picture's.")
    faces: Path | None = Field(None, description="Mesh file with the faces of SMPL.")
    body_model: Path | None = Field(None, description="SMPL model file, or the folder it is in.")
    camera_unit: LengthUnit = Field("millimetres", description="Unit of T in annots.npy.")
    up: Up | None = Field(None, description="Up of the world; null: as the cameras stand.")
    links: Links = Field("inside", description=LINKS)


def read_zju_mocap(
    source: Path,
    configuration: ZjuMocapConfig = ZjuMocapConfig(),  # noqa: B008 - frozen.
) -> DatasetScene:
    """One subject's folder (``CoreView_377``) as a scene. Pictures are read when written.

    Raises InputError for links that lead out of the folder, another layout, and for missing
    calibrations, pictures, masks, bodies.
    """
    require_inside(source, links_below(source), configuration.links)
    annotations = read_annotations(source, configuration.camera_unit)
    train = choose_camera(annotations, configuration.train_camera)
    subject = subject_of([source.resolve().name, *annotations.pictures[train].values()])
    pictures, masked = recorded_frames(source, annotations, train, configuration.masks)
    clip, clip_remarks = _clip(pictures, masked, subject, configuration)
    meshes, body_remarks = read_bodies(source, clip, _body_source(configuration))
    clip, trim_remarks = _with_bodies(clip, meshes)
    cameras, camera_remarks = _cameras(source, annotations, train, clip, configuration)
    up, up_remarks = _up(annotations, configuration)
    rate_remark = (
        f"the true rate is not known: the source counts as {configuration.fps:g} per second, "
        f"one frame in {configuration.stride} is learned from"
    )
    return DatasetScene(
        name=f"zju-mocap-{subject}" if subject else source.resolve().name,
        fps=configuration.fps,
        up=up,
        train_camera=train,
        cameras=cameras,
        meshes=meshes,
        truth=None,
        license=LICENSE,
        attribution=ATTRIBUTION,
        remarks=(
            *(rate_remark, *clip_remarks, *body_remarks, *trim_remarks, *camera_remarks),
            *up_remarks,
        ),
        behind_person="white" if configuration.background == "white" else "kept",
        caveats=of_multi_view_bodies(meshes),
        source_begins_at=int(pictures[0]),
        working_fps=configuration.fps / configuration.stride,
    )


def _clip(
    pictures: Indices, masked: Indices, subject: str | None, configuration: ZjuMocapConfig
) -> tuple[Indices, tuple[str, ...]]:
    wanted = chosen_range(subject, configuration.first_frame, configuration.frames)
    clip, remarks = unbroken_clip(wanted, pictures, masked)
    return clip, (*remarks, *bad_masks(subject, clip))


def _body_source(configuration: ZjuMocapConfig) -> BodySource:
    return BodySource(
        configuration.bodies,
        configuration.body_number_offset,
        configuration.faces,
        configuration.body_model,
    )


def _with_bodies(clip: Indices, meshes: DatasetMeshes | None) -> tuple[Indices, tuple[str, ...]]:
    """The clip from its first to its last body; gaps between are filled when meshes are used."""
    if meshes is None:
        return clip, ()
    first, last = meshes.sequence.frame_indices[[0, -1]]
    inside = clip[(clip >= first) & (clip <= last)]
    if len(inside) == len(clip):
        return clip, ()
    return inside, (f"the clip ends where bodies do: it holds frames {first} to {last}",)


def _cameras(
    folder: Path,
    annotations: ZjuAnnotations,
    train: str,
    clip: Indices,
    configuration: ZjuMocapConfig,
) -> tuple[dict[str, DatasetCamera], tuple[str, ...]]:
    """The train camera with the whole clip, the others with the frames that are learned from."""
    wanted = configuration.evaluation_cameras
    others = (
        [name for name in annotations.calibrations if name != train]
        if wanted is None
        else [choose_camera(annotations, name) for name in wanted]
    )
    cameras: dict[str, DatasetCamera] = {}
    remarks: list[str] = []
    for name in (train, *others):
        every = 1 if name == train else configuration.stride
        camera, said = open_camera(
            folder,
            annotations,
            name,
            clip[::every].tolist(),
            configuration.masks,
        )
        remarks += said
        if camera:
            cameras[name] = camera
    return cameras, tuple(remarks)


def _up(annotations: ZjuAnnotations, configuration: ZjuMocapConfig) -> tuple[Up, tuple[str, ...]]:
    if configuration.up:
        return configuration.up, (f"up is {configuration.up}, as asked for",)
    up, remark = up_of_cameras((one.R for one in annotations.calibrations.values()), EXPECTED_UP)
    return up, (remark,)
