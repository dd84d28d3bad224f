"""What the fast representation needs: residual motion, consensus, light, shell, detail."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.light import measure_light
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.planning.clip_decisions import decide_appearance, decide_motion
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision
from mocoflow_core.planning.mask_agreement import MaskAgreement, mask_agreement


class HybridPlan(NamedTuple):
    """Decisions, and the numbers that fields are built from."""

    decisions: tuple[Decision, ...]
    shell_width_m: float
    detail_m: float
    light: tuple[float, float, float]


def plan_hybrid(clip: Clip, posed: MeshSequence, configuration: PlanConfig) -> HybridPlan:
    """Decide from the train camera alone; ``posed`` holds the clip's frames."""
    agreement = mask_agreement(clip, posed)
    moves = decide_motion(clip, posed, configuration)
    residual = _residual(agreement, moves.needed, configuration)
    light = measure_light(clip, posed, configuration.light)
    lit = _light(light, configuration)
    shell = _shell(agreement, configuration)
    detail = _detail(agreement, configuration)
    decisions = (
        moves,
        residual,
        _consensus(residual, configuration),
        decide_appearance(clip, posed, configuration),
        lit,
        shell,
        detail,
    )
    return HybridPlan(
        decisions,
        _shell_width(agreement, shell, configuration),
        0.0 if detail.needed else _visible_detail_m(agreement, configuration),
        tuple((light if lit.needed else np.zeros(3)).tolist()),
    )


def _residual(agreement: MaskAgreement, moves: bool, configuration: PlanConfig) -> Decision:
    off_m = agreement.outline_px * agreement.pixel_m
    # An unknown agreement (no mask shows the person) is no evidence of a good one.
    wrong = not off_m <= configuration.consistent_m
    if not wrong:
        reason = "a residual motion gains too little for its time where outlines are so near"
    else:
        reason = "the body's outline is off the masks"
    return Decision(
        name="motion_residual",
        part="optimisation",
        needed=wrong and moves,
        reason=reason if moves else "the body stands still",
        evidence={"outline_m": off_m, "overlap": agreement.overlap},
        threshold=configuration.consistent_m,
        saves="the residual motion network: the body's own motion carries every point",
    ).forced(configuration.motion_residual)


def _consensus(residual: Decision, configuration: PlanConfig) -> Decision:
    if configuration.motion_consensus == "on" and not residual.needed:
        raise InputError(
            "plan.motion_residual must be on where plan.motion_consensus is on",
            f"a residual left out: {residual.reason}",
            "Set both on, or leave both on auto.",
        )
    return Decision(
        name="motion_consensus",
        part="optimisation",
        needed=residual.needed,
        reason="the residual motion must agree with its inverse and between frames"
        if residual.needed
        else "without a residual there is nothing to regularise",
        evidence=residual.evidence,
        threshold=residual.threshold,
        saves="the chains through the motion of two frames, about half of a step",
    ).forced(configuration.motion_consensus)


def _light(light: NDArray[np.float64], configuration: PlanConfig) -> Decision:
    strength = float(np.linalg.norm(light))
    needed = strength > configuration.faint_light
    return Decision(
        name="fixed_light",
        part="optimisation",
        needed=needed,
        reason="the person gets brighter when turning to one side"
        if needed
        else "the person is as bright from every side",
        evidence={"strength": strength, "x": light[0], "y": light[1], "z": light[2]},
        threshold=configuration.faint_light,
        saves="shading by the direction that the skin faces",
    ).forced(configuration.fixed_light)


def _shell(agreement: MaskAgreement, configuration: PlanConfig) -> Decision:
    room_m = configuration.narrowest_shell_m - configuration.shell_margin_m
    # An unknown agreement (no mask shows the person) is no evidence of a good one.
    wide = not agreement.outside_m <= room_m
    return Decision(
        name="wide_shell",
        part="optimisation",
        needed=wide,
        reason="the masks show the person farther out than the body"
        if wide
        else "the person stays close to the body",
        evidence={"outside_m": agreement.outside_m},
        threshold=room_m,
        saves="samples where no density can be: up to three quarters of them, half of a step",
    ).forced(configuration.wide_shell)


def _shell_width(agreement: MaskAgreement, shell: Decision, configuration: PlanConfig) -> float:
    """As wide as measured; the widest where it is unknown or asked for against the measurement."""
    narrow_m, wide_m = configuration.narrowest_shell_m, configuration.widest_shell_m
    if not shell.needed:
        return narrow_m
    measured = agreement.outside_m + configuration.shell_margin_m
    return min(measured if measured > narrow_m else wide_m, wide_m)


def _visible_detail_m(agreement: MaskAgreement, configuration: PlanConfig) -> float:
    detail_m = configuration.detail_px * agreement.pixel_m
    return float(detail_m) if np.isfinite(detail_m) else 0.0


def _detail(agreement: MaskAgreement, configuration: PlanConfig) -> Decision:
    coarse = _visible_detail_m(agreement, configuration) > configuration.fine_m
    return Decision(
        name="fine_detail",
        part="optimisation",
        needed=not coarse,
        reason="pixels are too coarse for what fine cells and short steps could show"
        if coarse
        else "pixels show as much as the fine cells and short steps can hold",
        evidence={"pixel_m": agreement.pixel_m},
        threshold=configuration.fine_m / configuration.detail_px,
        saves="cells and samples below a share of a pixel",
    ).forced(configuration.fine_detail)
