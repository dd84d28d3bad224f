"""What is taken of a sequence of AIST, and how."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.aist_names import BAD_VIEWS
from mocoflow_core.datasets.aist_time import Rounding
from mocoflow_core.datasets.dataset_scene import Up
from mocoflow_core.datasets.links import LINKS, Links


class AistConfig(ConfigurationPart):
    """What is taken of an AIST sequence; the defaults are the protocol of MoCo-Flow sec. 4."""

    sequence: str | None = Field(
        None, description="Name of the sequence or of one of its videos; null: the only one."
    )
    videos: Path | None = Field(None, description="Folder of the videos; null: found.")
    annotations: Path | None = Field(
        None, description="Folder with cameras/, motions/, keypoints3d/ of AIST++; null: found."
    )
    train_camera: str = Field(
        "c09", pattern=r"^c\d\d$", description="Camera to learn from; the paper: c09, also c01."
    )
    evaluation_cameras: tuple[str, ...] | None = Field(
        None, description="Cameras to score against; null: all others."
    )
    left_out_views: tuple[str, ...] = Field(
        BAD_VIEWS, description="Videos that are not used: those known to be wrong."
    )
    ignore_list: Literal["refuse", "warn"] = Field(
        "refuse", description="What to do with sequences whose annotations are known to be wrong."
    )
    first_frame: int = Field(0, ge=0, description="First frame, counted on the 60 Hz grid.")
    frames: int = Field(
        500, ge=1, description="Frames of the 60 Hz grid: 100 are learned from (paper: 80 to 120)."
    )
    stride: int = Field(
        5,
        ge=1,
        description="Every n-th frame is learned from, and taken of the other cameras: 60 to 12 "
        "per second in the paper.",
    )
    rounding: Rounding = Field(
        "down", description="How frames of videos not quite at 60 come onto the grid; AIST++: down."
    )
    scale: Literal["centimetres", "smpl"] = Field(
        "centimetres",
        description="What makes metres: true centimetres / 100, or the unit in which the body is "
        "as large as SMPL (it differs per sequence).",
    )
    masks: Path | None = Field(
        None, description="Folder with <video name>/000000.png; null: what differs from the plate."
    )
    background: Literal["plate", "filmed"] = Field(
        "plate",
        description="Plate: a reconstruction sets the person before the clip's median, without "
        "moving shadows; the scene's frames are as filmed.",
    )
    plate_frames: int = Field(
        48, ge=1, description="Frames that make the median, of those learned from."
    )
    difference_threshold: int = Field(
        30, ge=1, le=255, description="Difference to the plate that counts as the person, 1/255."
    )
    bodies: Literal["motion", "none"] = Field(
        "motion", description="Bodies posed from AIST++'s motion, or none: give some with --meshes."
    )
    body_model: Path | None = Field(
        None, description="Male SMPL model file, or the folder it is in."
    )
    up: Up | None = Field(None, description="Up of the world; null: as the cameras stand.")
    links: Links = Field("inside", description=LINKS)
