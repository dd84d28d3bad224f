"""Stage pretrain_density: the canonical density, started from the canonical mesh.

Of the fast representation in closed form, of the paper's networks by training.
"""

from __future__ import annotations

from mocoflow_core.artifacts import (
    ClipArtifact,
    DensityArtifact,
    PlanArtifact,
    RepairArtifact,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.network_field import NetworksConfig
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.rendering.frame_box import BoxConfig
from mocoflow_core.training import network_stages
from mocoflow_core.training import pretrain_density as training
from mocoflow_core.training.clock import TrainingClock
from mocoflow_core.training.mesh_views import MeshViewsConfig
from mocoflow_core.training.pretrain_density import DensityConfig
from mocoflow_core.training.schedule import ScheduleConfig
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 1  # First version.
NETWORKS_VERSION = 2  # A guard that keeps its distance after a rise.


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


@stage(DensityArtifact, NETWORKS_VERSION, resumes=True)
def pretrain_networks(
    work: Stage,
    clip: ClipArtifact,
    bodies: RepairArtifact,
    plan: PlanArtifact,
    networks: NetworksConfig,
    box: BoxConfig,
    views: MeshViewsConfig,
    schedule: ScheduleConfig,
    seed: int,
) -> Summary:
    """First stage with the paper's networks: images of the canonical mesh from all sides.

    Output: ``model.safetensors`` with boxes and shape. Minutes to days, resumed after a kill.
    """
    decided = ScenePlan.model_validate_json((work.open(plan) / "plan.json").read_text())
    begins = decided.needs("initialisation")
    result = network_stages.pretrain_networks(
        Clip.load(work.open(clip)),
        MeshSequence.load(work.open(bodies) / "meshes.npz"),
        decided.canonical_frame,
        decided.needs("motion_fields"),
        "frame" if decided.needs("adaptive_box") else "clip",
        networks,
        box,
        views,
        schedule if begins else schedule.without_steps(),
        seed,
        work.folder,
        work.progress,
        TrainingClock(paused=work.leave_out),
    )
    return {"canonical_frame": decided.canonical_frame, **result.summary()}
