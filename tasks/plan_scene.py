"""Stage plan_scene: what the optimisation of this scene needs, and why."""

from __future__ import annotations

from mocoflow_core.artifacts import (
    ClipArtifact,
    InspectionArtifact,
    PlanArtifact,
    RepairArtifact,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.planning import plan as planning
from mocoflow_core.planning.inspection import Inspection
from mocoflow_core.planning.plan import PlanConfig
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 1  # First version.


@stage(PlanArtifact, ALGORITHM_VERSION)
def plan_scene(
    work: Stage,
    clip: ClipArtifact,
    bodies: RepairArtifact,
    inspection: InspectionArtifact,
    plan: PlanConfig,
) -> Summary:
    """Decides from the train side alone; each decision carries its evidence.

    Output: ``plan.json``. A few seconds.
    """
    found = Inspection.model_validate_json((work.open(inspection) / "inspection.json").read_text())
    meshes = MeshSequence.load(work.open(bodies) / "meshes.npz")
    decided = planning.plan_scene(Clip.load(work.open(clip)), meshes, found, plan)
    (work.folder / "plan.json").write_text(decided.model_dump_json(indent=1))
    return {"needed": {decision.name: decision.needed for decision in decided.decisions}}
