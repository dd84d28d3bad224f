"""What the paper's networks need: consensus, initialisation, boxes that follow the body."""

from __future__ import annotations

import numpy as np

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.planning.clip_decisions import decide_appearance, decide_motion
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision


def plan_networks(
    clip: Clip, posed: MeshSequence, configuration: PlanConfig
) -> tuple[Decision, ...]:
    """Decide from the train camera alone; ``posed`` holds the clip's frames."""
    moves = decide_motion(clip, posed, configuration)
    return (
        moves,
        _consensus(moves, configuration),
        decide_appearance(clip, posed, configuration),
        _initialisation(moves, configuration),
        _box(clip, posed, configuration),
    )


def _consensus(moves: Decision, configuration: PlanConfig) -> Decision:
    if configuration.motion_consensus == "on" and not moves.needed:
        raise InputError(
            "plan.motion_fields must be on where plan.motion_consensus is on",
            f"motion left out: {moves.reason}",
            "Set both on, or leave both on auto.",
        )
    return Decision(
        name="motion_consensus",
        part="optimisation",
        needed=moves.needed,
        reason="both motion networks must agree with each other and between frames"
        if moves.needed
        else "the body stands still",
        evidence=moves.evidence,
        threshold=moves.threshold,
        saves="the chains through the motion of two frames, two thirds of a step",
    ).forced(configuration.motion_consensus)


def _initialisation(moves: Decision, configuration: PlanConfig) -> Decision:
    return Decision(
        name="initialisation",
        part="optimisation",
        needed=True,
        reason="one view does not tell networks that know nothing what moves and what is solid",
        evidence=moves.evidence,
        saves="density on images of the canonical mesh, and motion fitted to the meshes",
    ).forced(configuration.initialisation)


def _box(clip: Clip, posed: MeshSequence, configuration: PlanConfig) -> Decision:
    turned = posed.vertices.astype(np.float64) @ clip.camera.R.T
    own = np.prod(np.ptp(turned, axis=1), axis=1).mean()
    whole = np.prod(np.ptp(turned.reshape(-1, 3), axis=0))
    larger = float(whole / own) if own > 0 else float("nan")
    follows = not larger <= configuration.tight_box
    return Decision(
        name="adaptive_box",
        part="optimisation",
        needed=follows,
        reason="one box for the whole clip is mostly empty in each frame"
        if follows
        else "the body stays in its place: one box fits all frames",
        evidence={"times_larger": larger},
        threshold=configuration.tight_box,
        saves="a box for each frame",
    ).forced(configuration.adaptive_box)
