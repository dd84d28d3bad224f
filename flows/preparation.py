"""Everything before the optimisation: what both flows, plan and reconstruct, begin with."""

from __future__ import annotations

from dataclasses import dataclass, fields

from flows.request import Request
from mocoflow_core.artifacts import (
    Artifact,
    ClipArtifact,
    DensityArtifact,
    InspectionArtifact,
    LocationArtifact,
    MeshArtifact,
    MotionArtifact,
    PlanArtifact,
    RepairArtifact,
)
from mocoflow_core.capture.extract import ClipNeeds
from tasks.extract_clip import extract_clip
from tasks.fit_motion import fit_motion, fit_networks
from tasks.ingest_meshes import ingest_meshes
from tasks.inspect_scene import inspect_scene
from tasks.locate_body import locate_body
from tasks.plan_scene import plan_scene
from tasks.pretrain_density import pretrain_density, pretrain_networks
from tasks.repair_body import repair_body


@dataclass(frozen=True)
class Preparation:
    """What the optimisation starts from, in the order in which it was made."""

    given: MeshArtifact
    inspection: InspectionArtifact
    clip: ClipArtifact
    bodies: MeshArtifact | LocationArtifact
    repaired: RepairArtifact
    plan: PlanArtifact
    density: DensityArtifact
    motion: MotionArtifact

    @property
    def stages(self) -> tuple[Artifact, ...]:
        return tuple(getattr(self, field.name) for field in fields(self))


def prepare(request: Request) -> Preparation:
    """Run the stages before the optimisation, or find them in the store."""
    where, chosen = request.store, request.configuration
    given = ingest_meshes(
        where,
        request.recording,
        request.bodies,
        request.body_model,
        request.faces,
        chosen.meshes.without_files(),
    )
    inspection = inspect_scene(where, request.recording, given, chosen.plan)
    needs = ClipNeeds(
        background=inspection.holds("background_extraction"),
        masks=inspection.holds("mask_segmentation"),
        repeated_frames=chosen.plan.repeated_frames == "on",
    )
    turned = given if chosen.capture.least_shown > 0 else None
    clip = extract_clip(where, request.recording, chosen.capture, needs, turned)
    located = None
    if inspection.holds("location_search"):
        located = locate_body(where, clip, given, chosen.location_search)
    bodies = located or given
    repaired = repair_body(where, clip, bodies, chosen.repair, chosen.plan.body_repair)
    plan = plan_scene(
        where, clip, repaired, inspection, chosen.plan, chosen.representation, located
    )
    start = _start_networks if chosen.representation == "networks" else _start_hybrid
    density, motion = start(request, clip, repaired, plan)
    return Preparation(given, inspection, clip, bodies, repaired, plan, density, motion)


def _start_hybrid(
    request: Request, clip: ClipArtifact, bodies: RepairArtifact, plan: PlanArtifact
) -> tuple[DensityArtifact, MotionArtifact]:
    """Density and motion of the fast representation: measured on the mesh."""
    where, chosen = request.store, request.configuration
    density = pretrain_density(where, bodies, plan, chosen.density)
    return density, fit_motion(where, clip, bodies, plan, density, chosen.motion)


def _start_networks(
    request: Request, clip: ClipArtifact, bodies: RepairArtifact, plan: PlanArtifact
) -> tuple[DensityArtifact, MotionArtifact]:
    """Density and motion of the paper's networks: trained on the mesh."""
    where, chosen, seed = request.store, request.configuration, request.seed
    density = pretrain_networks(
        where,
        clip,
        bodies,
        plan,
        chosen.networks,
        chosen.box,
        chosen.mesh_views,
        chosen.schedule.pretraining(),
        seed,
    )
    fitted = fit_networks(
        where, clip, bodies, plan, density, chosen.losses, chosen.schedule.fitting(), seed
    )
    return density, fitted
