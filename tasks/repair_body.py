"""Stage repair_body: the body estimate is bent towards the train camera's masks."""

from __future__ import annotations

from mocoflow_core.artifacts import ClipArtifact, LocationArtifact, MeshArtifact, RepairArtifact
from mocoflow_core.body.mask_fit import MaskFitConfig, fit_to_masks
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.motion_checks import check_agreement
from mocoflow_core.capture.clip import Clip
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # Frames that fit far worse than the others are noticed.


@stage(RepairArtifact, ALGORITHM_VERSION)
def repair_body(
    work: Stage,
    clip: ClipArtifact,
    bodies: MeshArtifact | LocationArtifact,
    repair: MaskFitConfig,
) -> Summary:
    """Joints and place corrected before anything is learned; an estimate that agrees is kept.

    Output: ``meshes.npz`` in world metres. About a second, or 0.2 s a frame where it is needed.
    """
    seen = Clip.load(work.open(clip))
    given = MeshSequence.load(work.open(bodies) / "meshes.npz")
    fitted = fit_to_masks(seen, given, repair, work.progress)
    fitted.save(work.folder / "meshes.npz")
    return {"repaired": fitted is not given, "warnings": list(check_agreement(seen, fitted))}
