"""Whether a body estimate must be bent towards masks and colours, and the meshes after it."""

from __future__ import annotations

from collections.abc import Callable

from mocoflow_core.body.mask_misfit import expected_share
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.repair import RepairConfig, outlines_apart, repair_body
from mocoflow_core.capture.clip import Clip
from mocoflow_core.planning.decision import Decision, Force


def repair_where_needed(
    clip: Clip,
    meshes: MeshSequence,
    configuration: RepairConfig,
    force: Force,
    progress: Callable[[float, str], None],
) -> tuple[MeshSequence, Decision]:
    """The meshes as they are, or with joints and place corrected; and why.

    Args:
        meshes: world metres; holds every frame of the clip.
        force: on expects errors of the usual size, whatever the outlines show.
    """
    apart_px = outlines_apart(clip, meshes, configuration)
    expected = expected_share(apart_px, configuration.masks)
    decision = Decision(
        name="body_repair",
        part="preparation",
        needed=expected > 0,
        reason="the body's outline is off the masks"
        if expected > 0
        else "the body's outline agrees with the masks, or no mask shows it",
        evidence={"apart_px": apart_px},
        threshold=configuration.masks.agreeing_px,
        saves="bending joints towards masks and colours, about 0.2 s a frame",
    ).forced(force)
    if not decision.needed:
        return meshes, decision
    return repair_body(clip, meshes, expected or 1.0, configuration, progress), decision
