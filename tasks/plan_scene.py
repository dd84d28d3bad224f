"""Stage plan_scene: what the optimisation of this scene needs, and why."""

from __future__ import annotations

from mocoflow_core.artifacts import (
    ClipArtifact,
    InspectionArtifact,
    LocationArtifact,
    PlanArtifact,
    RepairArtifact,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.planning import plan as planning
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision, with_evidence
from mocoflow_core.planning.inspection import Inspection
from mocoflow_core.planning.preparation import decide_frames, decide_preparation, decide_shadows
from mocoflow_core.planning.visibility import visibility_warnings
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 5  # Says whether shadows are removed, and how sure the location is.


@stage(PlanArtifact, ALGORITHM_VERSION)
def plan_scene(
    work: Stage,
    clip: ClipArtifact,
    bodies: RepairArtifact,
    inspection: InspectionArtifact,
    plan: PlanConfig,
    representation: planning.Representation,
    located: LocationArtifact | None = None,
) -> Summary:
    """Decides from the train side alone; each decision carries its evidence.

    Output: ``plan.json``. A few seconds.
    """
    found = Inspection.model_validate_json((work.open(inspection) / "inspection.json").read_text())
    repair = Decision.model_validate_json((work.open(bodies) / "decision.json").read_text())
    meshes = MeshSequence.load(work.open(bodies) / "meshes.npz")
    seen = Clip.load(work.open(clip))
    frames = decide_frames(clip.summary["repeated"], clip.summary["frames"], plan)
    shadows = decide_shadows(clip.summary["shadowed"], clip.summary["behind_person"], plan)
    before = decide_preparation(found, plan)
    if located:
        before = with_evidence(before, "location_search", located.summary["quality"])
    preparation = (*before, frames, shadows, repair)
    decided = planning.plan_scene(seen, meshes, preparation, plan, representation)
    (work.folder / "plan.json").write_text(decided.model_dump_json(indent=1))
    return {
        "needed": {decision.name: decision.needed for decision in decided.decisions},
        "warnings": list(visibility_warnings(decided.unseen_share, seen.camera.name)),
    }
