"""Stage repair_body: the body estimate is bent towards the train camera's masks."""

from __future__ import annotations

from mocoflow_core.artifacts import ClipArtifact, LocationArtifact, MeshArtifact, RepairArtifact
from mocoflow_core.body import repair as repairing
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.motion_checks import check_agreement
from mocoflow_core.body.repair import RepairConfig
from mocoflow_core.capture.clip import Clip
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # Fits the colours as well; frames that fit far worse are noticed.


@stage(RepairArtifact, ALGORITHM_VERSION)
def repair_body(
    work: Stage,
    clip: ClipArtifact,
    bodies: MeshArtifact | LocationArtifact,
    repair: RepairConfig,
) -> Summary:
    """Joints and place corrected before anything is learned; an estimate that agrees is kept.

    Output: ``meshes.npz`` in world metres. About a second, or 0.2 s a frame where it is needed.
    """
    seen = Clip.load(work.open(clip))
    given = MeshSequence.load(work.open(bodies) / "meshes.npz")
    fitted = repairing.repair_body(seen, given, repair, work.progress)
    fitted.save(work.folder / "meshes.npz")
    return {"repaired": fitted is not given, "warnings": list(check_agreement(seen, fitted))}
