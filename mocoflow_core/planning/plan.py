"""What the optimisation of a scene needs, decided from measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from mocoflow_core.body.light import LightConfig, measure_light
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.scene import Scene
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.planning.brightness import brightness_shifts
from mocoflow_core.planning.canonical_frame import closeness
from mocoflow_core.planning.decision import Decision, Force
from mocoflow_core.planning.inspection import Inspection
from mocoflow_core.planning.mask_agreement import MaskAgreement, mask_agreement


class PlanConfig(ConfigurationPart):
    """Thresholds of the decisions; each decision can be forced on or off."""

    background_extraction: Force = "auto"
    mask_segmentation: Force = "auto"
    location_search: Force = "auto"
    motion_fields: Force = "auto"
    motion_residual: Force = "auto"
    motion_consensus: Force = "auto"
    appearance_codes: Force = "auto"
    fixed_light: Force = "auto"
    trusted_overlap: float = Field(
        0.6, ge=0, le=1, description="Silhouette overlap from which a given location is trusted."
    )
    still_px: float = Field(
        0.5, ge=0, description="A body whose points move less than this, in pixels, is still."
    )
    consistent_px: float = Field(
        1.5, ge=0, description="Outlines nearer than this, in pixels, leave nothing to correct."
    )
    constant_brightness: float = Field(
        0.02, ge=0, description="Brightness of the person that changes less than this is constant."
    )
    light: LightConfig = LightConfig()
    faint_light: float = Field(
        0.05, ge=0, description="A light that changes brightness by less than this is left out."
    )
    narrowest_shell_m: float = Field(0.03, gt=0, description="Least shell around the body, metres.")
    widest_shell_m: float = Field(0.15, gt=0, description="Largest shell around the body, metres.")


class ScenePlan(BaseModel):
    """Every decision with its evidence, and the two numbers the fields are built from."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    decisions: tuple[Decision, ...]
    canonical_frame: int  # source number
    shell_width_m: float  # density can be so far from the body
    light: tuple[float, float, float]  # linear brightness is 1 + light . normal, world space

    def needs(self, name: str) -> bool:
        """Whether the named thing is to be done. Raises KeyError for an unknown name."""
        return self.decision(name).needed

    def decision(self, name: str) -> Decision:
        """The named decision. Raises KeyError for an unknown name."""
        for decision in self.decisions:
            if decision.name == name:
                return decision
        raise KeyError(f"no decision {name!r}: {', '.join(d.name for d in self.decisions)}")


def plan_scene(
    clip: Clip, meshes: MeshSequence, inspection: Inspection, configuration: PlanConfig
) -> ScenePlan:
    """Decide from the train camera alone. ``meshes`` in world metres, covering the clip."""
    posed = meshes.at(clip.frame_indices)
    agreement = mask_agreement(clip, posed)
    moves = _moves(clip, posed, configuration)
    residual = _residual(agreement, moves.needed, configuration)
    light = measure_light(clip, posed, configuration.light)
    lit = _light(light, configuration)
    decisions = (
        _background(inspection).forced(configuration.background_extraction),
        _segmentation(inspection).forced(configuration.mask_segmentation),
        decide_location(inspection, configuration),
        moves,
        residual,
        _consensus(residual).forced(configuration.motion_consensus),
        _appearance(clip, posed, configuration),
        lit,
    )
    trained = np.flatnonzero(~clip.held_out)
    spread = closeness(posed.at(clip.frame_indices[trained]))
    shell = agreement.outside_m if np.isfinite(agreement.outside_m) else np.inf
    return ScenePlan(
        decisions=decisions,
        canonical_frame=int(clip.frame_indices[trained[spread.argmin()]]),
        shell_width_m=float(
            np.clip(shell, configuration.narrowest_shell_m, configuration.widest_shell_m)
        ),
        light=tuple((light if lit.needed else np.zeros(3)).tolist()),
    )


def decide_location(inspection: Inspection, configuration: PlanConfig) -> Decision:
    """Whether the body's location must be searched; asked before any mesh is in the world.

    Raises InputError when it is forced off for meshes that have no location at all.
    """
    overlap = inspection.overlap
    if inspection.coordinates == "camera-root-centred" and configuration.location_search == "off":
        raise InputError(
            "meshes with a location when plan.location_search is off",
            "root-centred ones",
            "Leave plan.location_search on auto.",
        )
    if not inspection.located:
        reason = "the meshes come without a location that can be trusted"
        needed = True
    elif overlap is not None and overlap < configuration.trusted_overlap:
        reason = f"the given location overlaps the masks by {overlap:.2f} only"
        needed = True
    else:
        reason = "the meshes come with a location that overlaps the masks well"
        needed = False
    return Decision(
        name="location_search",
        needed=needed,
        reason=reason,
        evidence={} if overlap is None else {"overlap": overlap},
        threshold=configuration.trusted_overlap,
        saves="the 3-D grid search, about 0.1 s a frame",
    ).forced(configuration.location_search)


def decide_evaluation(scene: Scene) -> Decision:
    """Whether other cameras can be scored. For the protocol alone: it must not reach a plan."""
    cameras = [name for name in scene.evaluation_cameras if scene.masks(name)]
    return Decision(
        name="evaluation_cameras",
        needed=bool(cameras),
        reason=f"{len(cameras)} other cameras have masks to score against"
        if cameras
        else "no other camera with masks: held-out frames of the train camera remain",
        evidence={"cameras": float(len(cameras))},
        threshold=1.0,
        saves="rendering and scoring the other cameras' views",
    )


def _background(inspection: Inspection) -> Decision:
    given = inspection.background_given
    return Decision(
        name="background_extraction",
        needed=not given,
        reason="the scene brings a background plate" if given else "the scene brings no plate",
        evidence={"plates": float(given)},
        threshold=1.0,
        saves="the median over the frames in which the person does not cover a pixel",
    )


def _segmentation(inspection: Inspection) -> Decision:
    given = inspection.masks_given
    return Decision(
        name="mask_segmentation",
        needed=not given,
        reason="the scene brings masks" if given else "masks are the difference to the background",
        evidence={"masks": float(given)},
        threshold=1.0,
        saves="segmenting every frame",
    )


def _moves(clip: Clip, meshes: MeshSequence, configuration: PlanConfig) -> Decision:
    pixels = clip.camera.project(meshes.vertices.astype(np.float64))
    moved_px = float(np.percentile(np.linalg.norm(pixels - pixels[:1], axis=-1), 95))
    moves = moved_px > configuration.still_px
    return Decision(
        name="motion_fields",
        needed=moves,
        reason="the body moves" if moves else "the body stands still",
        evidence={"moved_px": moved_px},
        threshold=configuration.still_px,
        saves="both motion fields: every frame sees the canonical body",
    ).forced(configuration.motion_fields)


def _residual(agreement: MaskAgreement, moves: bool, configuration: PlanConfig) -> Decision:
    off_px = agreement.outline_px
    # An unknown agreement (no mask shows the person) is no evidence of a good one.
    wrong = not off_px <= configuration.consistent_px
    if not wrong:
        reason = "the body's outline agrees with the masks to a pixel"
    else:
        reason = "the body's outline is off the masks"
    return Decision(
        name="motion_residual",
        needed=wrong and moves,
        reason=reason if moves else "the body stands still",
        evidence={"outline_px": off_px, "overlap": agreement.overlap},
        threshold=configuration.consistent_px,
        saves="the residual motion network: the body's own motion carries every point",
    ).forced(configuration.motion_residual)


def _consensus(residual: Decision) -> Decision:
    return Decision(
        name="motion_consensus",
        needed=residual.needed,
        reason="the residual motion must agree with its inverse and between frames"
        if residual.needed
        else "without a residual there is nothing to regularise",
        evidence=residual.evidence,
        threshold=residual.threshold,
        saves="the chains through the motion of two frames, about half of a step",
    )


def _appearance(clip: Clip, meshes: MeshSequence, configuration: PlanConfig) -> Decision:
    shifts = brightness_shifts(clip, meshes)[~clip.held_out]
    known = shifts[np.isfinite(shifts)]
    changes = float(np.percentile(np.abs(known), 95)) if len(known) else float("nan")
    varies = not changes <= configuration.constant_brightness
    return Decision(
        name="appearance_codes",
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
        needed=needed,
        reason="the person gets brighter when turning to one side"
        if needed
        else "the person is as bright from every side",
        evidence={"strength": strength, "x": light[0], "y": light[1], "z": light[2]},
        threshold=configuration.faint_light,
        saves="shading by the direction that the skin faces",
    ).forced(configuration.fixed_light)
