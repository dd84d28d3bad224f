"""Stage pretrain_density: the canonical density, started from the canonical mesh."""

from __future__ import annotations

from mocoflow_core.artifacts import DensityArtifact, PlanArtifact, RepairArtifact
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.training import pretrain_density as training
from mocoflow_core.training.pretrain_density import DensityConfig
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 1  # First version.


@stage(DensityArtifact, ALGORITHM_VERSION)
def pretrain_density(
    work: Stage,
    bodies: RepairArtifact,
    plan: PlanArtifact,
    density: DensityConfig,
) -> Summary:
    """First stage of the optimisation (MoCo-Flow sec. 3.4).

    Output: the canonical mesh and its signed distance. About a second.
    """
    decided = ScenePlan.model_validate_json((work.open(plan) / "plan.json").read_text())
    meshes = MeshSequence.load(work.open(bodies) / "meshes.npz")
    training.pretrain_density(meshes, decided.canonical_frame, density).save(work.folder)
    return {"canonical_frame": decided.canonical_frame}
