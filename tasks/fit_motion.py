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
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.training import fit_motion as training
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # A body that stands still has one table for all frames.


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
    )
    start.save(work.folder)
    return asdict(start.fit)
