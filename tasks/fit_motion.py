"""Stage fit_motion: both directions of the motion, started from the body mesh's own motion."""

from __future__ import annotations

from dataclasses import asdict

from mocoflow_core.artifacts import (
    ClipArtifact,
    DensityArtifact,
    MotionArtifact,
    PlanArtifact,
    RepairArtifact,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_shape import MotionConfig
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.training import fit_motion as training
from mocoflow_core.training import network_stages
from mocoflow_core.training.clock import TrainingClock
from mocoflow_core.training.problem import Learned
from mocoflow_core.training.schedule import ScheduleConfig
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # A body that stands still has one table for all frames.
NETWORKS_VERSION = 2  # A guard that keeps its distance after a rise.


@stage(MotionArtifact, ALGORITHM_VERSION)
def fit_motion(
    work: Stage,
    clip: ClipArtifact,
    bodies: RepairArtifact,
    plan: PlanArtifact,
    density: DensityArtifact,
    motion: MotionConfig,
) -> Summary:
    """Second stage of the optimisation (MoCo-Flow sec. 3.4).

    Output: the body's motion as controls and look-up tables, and how well it reproduces the mesh.
    A few seconds.
    """
    decided = ScenePlan.model_validate_json((work.open(plan) / "plan.json").read_text())
    start = training.fit_motion(
        Clip.load(work.open(clip)),
        MeshSequence.load(work.open(bodies) / "meshes.npz"),
        CanonicalDensity.load(work.open(density)),
        decided.shell_width_m,
        decided.needs("motion_fields"),
        motion,
        work.progress,
    )
    start.save(work.folder)
    return asdict(start.fit)


@stage(MotionArtifact, NETWORKS_VERSION, resumes=True)
def fit_networks(
    work: Stage,
    clip: ClipArtifact,
    bodies: RepairArtifact,
    plan: PlanArtifact,
    pretrained: DensityArtifact,
    losses: LossConfig,
    schedule: ScheduleConfig,
    seed: int,
) -> Summary:
    """Second stage with the paper's networks: motion and colours, density frozen.

    Output: ``model.safetensors`` with boxes and shape. Minutes to days, resumed after a kill.
    """
    decided = ScenePlan.model_validate_json((work.open(plan) / "plan.json").read_text())
    begins = decided.needs("initialisation")
    result = network_stages.fit_networks(
        Clip.load(work.open(clip)),
        MeshSequence.load(work.open(bodies) / "meshes.npz"),
        work.open(pretrained),
        Learned(
            consensus=decided.needs("motion_consensus"),
            appearance_codes=decided.needs("appearance_codes"),
        ),
        losses,
        schedule if begins else schedule.without_steps(),
        seed,
        work.folder,
        work.progress,
        TrainingClock(paused=work.leave_out),
    )
    return result.summary()
