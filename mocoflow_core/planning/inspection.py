"""A cheap look at a scene's files and a few frames of the train camera."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from mocoflow_core.body.body_checks import check_distance, check_height, check_overlap, check_path
from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.capture.checks import check_capture, check_masks, check_rate
from mocoflow_core.capture.extract import (
    CaptureConfig,
    extract_camera,
    select_training_frames,
)
from mocoflow_core.capture.frame_selection import FrameSelection
from mocoflow_core.capture.scene import Scene
from mocoflow_core.configuration import ConfigurationPart


class InspectionConfig(ConfigurationPart):
    """How closely a scene is looked at."""

    frames: int = Field(9, ge=2, description="Frames looked at, spread over the clip.")
    max_side: int = Field(384, ge=16, description="Longer side at which they are looked at, px.")


class Inspection(BaseModel):
    """What the train camera's side of a scene brings and what was measured. Unknown is None."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    frame_count: int
    source_fps: float
    width: int
    height: int
    masks_given: int
    background_given: bool
    coordinates: str | None
    located: bool | None
    foreground_share: float
    background_motion_px: float | None
    body_height_m: float | None = None
    body_distance_m: float | None = None
    fastest_m_s: float | None = None
    overlap: float | None = None
    overlap_previous_mesh: float | None = None
    overlap_next_mesh: float | None = None
    warnings: tuple[str, ...] = ()


def inspect_scene(
    scene: Scene,
    meshes: IngestedMeshes | None,
    configuration: InspectionConfig = InspectionConfig(),  # noqa: B008 - frozen.
) -> Inspection:
    """Look at the train camera; no other camera and no truth is opened.

    Raises InputError as the extraction does for frames and masks that do not fit.
    """
    capture = CaptureConfig(max_side=configuration.max_side)
    available = select_training_frames(scene, capture).working
    rows = np.linspace(0, len(available) - 1, min(configuration.frames, len(available)))
    looked_at = available[rows.round().astype(int)]
    selection = FrameSelection(looked_at, looked_at[:0], scene.description.fps)
    clip = extract_camera(scene, scene.train_camera, selection, capture)
    camera = scene.cameras[scene.train_camera]
    frames = scene.frames(scene.train_camera)
    findings = check_capture(clip, camera)
    files = check_rate(frames.fps, scene.description.fps)
    files += check_masks(scene.masks(scene.train_camera), frames.indices.tolist())
    motion_px = findings.background_motion_px
    inspection = Inspection(
        frame_count=len(frames.indices),
        source_fps=scene.description.fps,
        width=camera.width,
        height=camera.height,
        masks_given=len(scene.masks(scene.train_camera)),
        background_given=scene.background(scene.train_camera) is not None,
        coordinates=meshes.coordinates if meshes else None,
        located=meshes.located if meshes else None,
        foreground_share=findings.foreground_share,
        background_motion_px=motion_px if np.isfinite(motion_px) else None,
        warnings=findings.warnings + files,
    )
    if meshes is None:
        return inspection
    in_world = meshes.coordinates == "world"
    up = scene.up if in_world else camera.R @ scene.up
    height, warnings = check_height(meshes.meshes.vertices, up)
    measured: dict[str, object] = {"body_height_m": height}
    if in_world:
        distance, distance_warnings = check_distance(meshes.meshes, camera)
        overlaps, overlap_warnings = check_overlap(clip, meshes.meshes)
        speed, path_warnings = check_path(meshes.meshes, scene.description.fps)
        warnings += distance_warnings + overlap_warnings + path_warnings
        measured |= {
            "body_distance_m": distance,
            "fastest_m_s": speed,
            "overlap": overlaps[0],
            "overlap_previous_mesh": overlaps[-1],
            "overlap_next_mesh": overlaps[1],
        }
    measured["warnings"] = inspection.warnings + meshes.warnings + warnings
    return inspection.model_copy(update=measured)
