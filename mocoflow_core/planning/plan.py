"""What the optimisation of a scene needs, decided from measurements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from mocoflow_core.body.light import measure_light
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.planning.brightness import brightness_shifts
from mocoflow_core.planning.canonical_frame import closeness
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision
from mocoflow_core.planning.mask_agreement import MaskAgreement, mask_agreement
from mocoflow_core.planning.visibility import unseen_share


class ScenePlan(BaseModel):
    """Every decision with its evidence, and the numbers the fields are built from."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    decisions: tuple[Decision, ...]
    canonical_frame: int  # source number
    shell_width_m: float  # density can be so far from the body
    detail_m: float  # no cell and no step needs to be finer; 0: as the configuration says
    light: tuple[float, float, float]  # linear brightness is 1 + light . normal, world space
    unseen_share: float  # of the body's surface, from the train camera

    def needs(self, name: str) -> bool:
        """Whether the named thing is to be done. Raises KeyError for an unknown name."""
        return self.decision(name).needed

    def decision(self, name: str) -> Decision:
        """The named decision. Raises KeyError for an unknown name."""
        for decision in self.decisions:
            if decision.name == name:
                return decision
        raise KeyError(f"no decision {name!r}: {', '.join(d.name for d in self.decisions)}")

    def no_finer(self, length_m: float) -> float:
        """A cell or step of this length, or a coarser one where pixels cannot show it."""
        return max(length_m, self.detail_m)


def plan_scene(
    clip: Clip,
    meshes: MeshSequence,
    preparation: Sequence[Decision],
    configuration: PlanConfig,
) -> ScenePlan:
    """Decide from the train camera alone.

    Args:
        meshes: world metres, covering the clip.
        preparation: what was decided before, to be listed first.
    """
    posed = meshes.at(clip.frame_indices)
    agreement = mask_agreement(clip, posed)
    moves = _moves(clip, posed, configuration)
    residual = _residual(agreement, moves.needed, configuration)
    light = measure_light(clip, posed, configuration.light)
    lit = _light(light, configuration)
    shell = _shell(agreement, configuration)
    detail = _detail(agreement, configuration)
    decisions = (
        *preparation,
        moves,
        residual,
        _consensus(residual, configuration),
        _appearance(clip, posed, configuration),
        lit,
        shell,
        detail,
    )
    trained = np.flatnonzero(~clip.held_out)
    spread = closeness(posed.at(clip.frame_indices[trained]))
    return ScenePlan(
        decisions=decisions,
        canonical_frame=int(clip.frame_indices[trained[spread.argmin()]]),
        shell_width_m=_shell_width(agreement, shell, configuration),
        detail_m=0.0 if detail.needed else _visible_detail_m(agreement, configuration),
        light=tuple((light if lit.needed else np.zeros(3)).tolist()),
        unseen_share=unseen_share(clip, posed),
    )


def _moves(clip: Clip, meshes: MeshSequence, configuration: PlanConfig) -> Decision:
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
        saves="a look-up table of the motion for each frame: all frames share one",
    ).forced(configuration.motion_fields)


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


def _appearance(clip: Clip, meshes: MeshSequence, configuration: PlanConfig) -> Decision:
    shifts = brightness_shifts(clip, meshes)[~clip.held_out]
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
