"""Stage repair_body: the body estimate is bent towards the train camera's masks."""

from __future__ import annotations

from mocoflow_core.artifacts import ClipArtifact, LocationArtifact, MeshArtifact, RepairArtifact
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.motion_checks import check_agreement
from mocoflow_core.body.repair import RepairConfig
from mocoflow_core.capture.clip import Clip
from mocoflow_core.planning.decision import Force
from mocoflow_core.planning.repair import repair_where_needed
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 4  # Near and far cost alike; a place that was searched may be far off.


@stage(RepairArtifact, ALGORITHM_VERSION)
def repair_body(
    work: Stage,
    clip: ClipArtifact,
    bodies: MeshArtifact | LocationArtifact,
    repair: RepairConfig,
    force: Force,
) -> Summary:
    """Joints and place corrected before anything is learned; an estimate that agrees is kept.

    Output: ``meshes.npz`` in world metres, ``decision.json``. About a second, or 0.2 s a frame
    where it is needed.
    """
    seen = Clip.load(work.open(clip))
    given = MeshSequence.load(work.open(bodies) / "meshes.npz")
    usual = repair.after_search() if bodies.holds("adopted") else repair
    meshes, decision = repair_where_needed(seen, given, usual, force, work.progress)
    meshes.save(work.folder / "meshes.npz")
    (work.folder / "decision.json").write_text(decision.model_dump_json(indent=1))
    return {"repaired": decision.needed, "warnings": list(check_agreement(seen, meshes))}
