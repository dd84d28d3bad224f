"""What the clip and the meshes say, whatever represents the scene."""

from __future__ import annotations

import numpy as np

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.planning.brightness import brightness_shifts
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision


def decide_motion(clip: Clip, meshes: MeshSequence, configuration: PlanConfig) -> Decision:
    """Whether the body moves at all."""
    pixels = clip.camera.project(meshes.vertices.astype(np.float64))
    moved_px = float(np.percentile(np.linalg.norm(pixels - pixels[:1], axis=-1), 95))
    moves = moved_px > configuration.still_px
    return Decision(
        name="motion_fields",
        part="optimisation",
        needed=moves,
        reason="the body moves" if moves else "the body stands still",
        evidence={"moved_px": moved_px},
        threshold=configuration.still_px,
        saves="the motion of each frame: all frames share one",
    ).forced(configuration.motion_fields)


def decide_appearance(clip: Clip, meshes: MeshSequence, configuration: PlanConfig) -> Decision:
    """Whether each image needs an appearance code of its own."""
    training = ~clip.held_out
    shifts = brightness_shifts(clip.at_rows(training), meshes.at(clip.frame_indices[training]))
    known = shifts[np.isfinite(shifts)]
    changes = float(np.percentile(np.abs(known), 95)) if len(known) else float("nan")
    varies = not changes <= configuration.constant_brightness
    return Decision(
        name="appearance_codes",
        part="optimisation",
        needed=varies,
        reason="the person's brightness changes over the clip"
        if varies
        else "the person's brightness is constant over the clip",
        evidence={"brightness_change": changes},
        threshold=configuration.constant_brightness,
        saves="a code for each frame and the overfitting it invites",
    ).forced(configuration.appearance_codes)
