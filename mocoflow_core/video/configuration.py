"""What may be said of a bare video."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from mocoflow_core.body.fit.fit_body import BodyFitConfig
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.perception.network_file import NetworkFile


class VideoConfig(ConfigurationPart):
    """How a bare video becomes a scene."""

    start_s: float = Field(0.0, ge=0, description="The clip starts so many seconds in.")
    end_s: float | None = Field(None, gt=0, description="And ends here; null: with the video.")
    longest_s: float = Field(60.0, gt=0, description="Longer clips are refused.")
    fps: float = Field(30.0, gt=0, description="Frames of the scene per second, at most.")
    working_fps: float = Field(12.0, gt=0, description="Frames that are learned from.")
    max_side: int = Field(1280, ge=64, description="Longer side of the scene's frames, pixels.")
    focal_px: float | None = Field(
        None, gt=0, description="Focal length, pixels of the video; null: stated in it or guessed."
    )
    person: int | None = Field(
        None, ge=0, description="Which of the persons, from 0 by size; null: the only large one."
    )
    bodies: Literal["fitted", "none"] = Field(
        "fitted", description="None: meshes are given with --meshes later."
    )
    body: BodyFitConfig = BodyFitConfig()
    segmenter: NetworkFile | None = Field(
        None,
        description="A Mask R-CNN that finds the person's pixels: .onnx, or weights of "
        "torchvision; null: BlazePose.",
    )
    least_difference: int = Field(
        30, ge=1, le=255, description="Difference to the plate that is no noise, 1/255."
    )
    plate_frames: int = Field(24, ge=2, description="At most so many frames make the plate.")
