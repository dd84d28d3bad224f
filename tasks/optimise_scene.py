"""Stage optimise_scene: all fields together, coarse to fine, against the train camera."""

from __future__ import annotations

from mocoflow_core.artifacts import (
    ClipArtifact,
    DensityArtifact,
    MotionArtifact,
    PlanArtifact,
    SceneArtifact,
)
from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.scene_shape import MotionConfig, SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.devices import Devices
from mocoflow_core.training.job import NetworkJob, ShellJob, TrainingJob
from mocoflow_core.training.on_devices import optimise_on
from mocoflow_core.training.problem import Learned
from mocoflow_core.training.schedule import ScheduleConfig
from tasks.growing_curve import GrowingCurve
from tasks.stage import Aside, Stage, Summary, stage

ALGORITHM_VERSION = 3  # Weights averaged over the last steps; a guard that keeps its distance.
NETWORKS_VERSION = 2  # A guard that keeps its distance.


@stage(SceneArtifact, ALGORITHM_VERSION, resumes=True)
def optimise_scene(
    work: Stage,
    clip: ClipArtifact,
    plan: PlanArtifact,
    density: DensityArtifact,
    motion: MotionArtifact,
    before: Aside,
    devices: Aside,
    canonical: CanonicalConfig,
    moving: MotionConfig,
    sampling: SamplingConfig,
    losses: LossConfig,
    schedule: ScheduleConfig,
    seed: int,
) -> Summary:
    """Third stage of the optimisation (MoCo-Flow sec. 3.4), resumed where a killed try left it.

    Output: ``model.safetensors`` with what is needed to open it, ``snapshots/``, ``result.json``.
    Nearly all of a run's time.
    """
    seen = Clip.load(work.open(clip))
    decided = ScenePlan.model_validate_json((work.open(plan) / "plan.json").read_text())
    canonical = canonical.model_copy(update={"finest_m": decided.no_finer(canonical.finest_m)})
    sampling = sampling.model_copy(update={"step_m": decided.no_finer(sampling.step_m)})
    job = ShellJob(
        clip=work.open(clip),
        density=work.open(density),
        motion=work.open(motion),
        shape=SceneShape(
            canonical=canonical,
            motion=moving,
            times=tuple(seen.times[~seen.held_out].tolist()),
            shell_width_m=decided.shell_width_m,
            inner_depth_m=sampling.inner_depth_m,
            step_m=sampling.step_m,
            residual=decided.needs("motion_residual"),
            light=decided.light,
        ),
        learned=Learned(
            motion_residual=decided.needs("motion_residual"),
            consensus=decided.needs("motion_consensus"),
            appearance_codes=decided.needs("appearance_codes"),
        ),
        losses=losses,
        schedule=schedule,
        seed=seed,
        before=_spent(before),
    )
    return _optimise(work, job, before, devices)


@stage(SceneArtifact, NETWORKS_VERSION, resumes=True)
def optimise_networks(
    work: Stage,
    clip: ClipArtifact,
    plan: PlanArtifact,
    fitted: MotionArtifact,
    before: Aside,
    devices: Aside,
    losses: LossConfig,
    schedule: ScheduleConfig,
    seed: int,
) -> Summary:
    """Third stage with the paper's networks, from the weights that fit_motion has left.

    Output: as of the fast representation. Minutes to days.
    """
    decided = ScenePlan.model_validate_json((work.open(plan) / "plan.json").read_text())
    job = NetworkJob(
        clip=work.open(clip),
        fitted=work.open(fitted),
        learned=Learned(
            consensus=decided.needs("motion_consensus"),
            appearance_codes=decided.needs("appearance_codes"),
        ),
        losses=losses,
        schedule=schedule,
        seed=seed,
        before=_spent(before),
    )
    return _optimise(work, job, before, devices)


def _spent(before: Aside) -> Seconds:
    """The training clock at the start."""
    return Seconds(float(before.values["wall_s"]), float(before.values["cpu_s"]))


def _optimise(work: Stage, job: TrainingJob, before: Aside, devices: Aside) -> Summary:
    """Train, and tell what it came to."""
    result = optimise_on(
        Devices(**devices.values),
        job,
        work.folder,
        work.progress,
        GrowingCurve(job.before).show,
        work.leave_out,
        work.log,
    )
    return {
        "steps": result.steps,
        "rays": result.rays,
        "threads": result.threads,
        "tries": result.tries,
        "events": [str(event) for event in result.events],
        "losses": result.losses,
        "train_psnr": result.train_psnr,
        "held_out": result.held_out,
        "warnings": list(result.warnings),
        "machine": before.values["machine"],
        "devices": Devices(**devices.values).in_all,
        "before_wall_s": job.before.wall,
        "before_cpu_s": job.before.cpu,
    }
