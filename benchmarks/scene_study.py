"""One scene of a study: prepared once, trained many times, scored at views of other cameras.

What the flow does between a scene folder and its scores, on the core's own functions and without
a store. The training clock shows CPU seconds, also to a budget: what one idle core would take,
whatever else the machine does.
"""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from mocoflow_core.body.location import locate_body
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import ClipNeeds, extract_clip, extract_evaluation
from mocoflow_core.capture.scene import Scene
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.methods.rendered_views import ScoredView, TrainedRenderer, scored_views
from mocoflow_core.methods.scored_views import (
    Moment,
    Subject,
    error_curve,
    few_views,
    score_views,
)
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.planning.inspection import inspect_scene
from mocoflow_core.planning.plan import ScenePlan, plan_scene
from mocoflow_core.planning.preparation import decide_frames, decide_preparation
from mocoflow_core.planning.repair import repair_where_needed
from mocoflow_core.presets import Configuration
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.fit_motion import MotionStart, fit_motion
from mocoflow_core.training.optimise_scene import OptimisationResult, optimise_scene
from mocoflow_core.training.pretrain_density import pretrain_density
from mocoflow_core.training.problem import Learned, shell_problem
from mocoflow_core.training.snapshots import Snapshot, read_snapshots, snapshot_weights


class Trained(NamedTuple):
    """One optimisation, and its mean scores over a few views of other cameras."""

    result: OptimisationResult
    scores: dict[str, float]
    renderer: TrainedRenderer


class Start(NamedTuple):
    """What the optimisation starts from, and the meshes as they came."""

    clip: Clip
    given: MeshSequence  # where they were placed, joints as they came
    repaired: MeshSequence
    plan: ScenePlan
    density: CanonicalDensity
    motion: MotionStart


class PreparedScene:
    """What the optimisation starts from; ``spent`` is the training clock up to there."""

    def __init__(self, scene: Scene, configuration: Configuration) -> None:
        self.name = scene.description.name
        clock = TrainingClock(now=_cpu_now)
        self.start = _prepare(scene, configuration)
        self.spent = clock.read()
        self.clip, self.plan = self.start.clip, self.start.plan
        self._views = _views(scene, self.clip, configuration)
        self._evaluation: EvaluationConfig = configuration.evaluation

    def train(self, configuration: Configuration, seed: int) -> Trained:
        """Optimise as the plan says and score the result."""
        with TemporaryDirectory() as folder:
            result = self._optimise(configuration, seed, Path(folder))
            renderer = TrainedRenderer(TrainedScene.open(Path(folder)), self.clip)
        return Trained(result, self._scores(renderer), renderer)

    def curve(self, configuration: Configuration, seed: int, method: str) -> list[CurveRow]:
        """Optimise as the plan says and score every snapshot, on the whole training clock."""
        with TemporaryDirectory() as name:
            folder = Path(name)
            self._optimise(configuration, seed, folder)
            moments = [self._moment(folder, s, method) for s in read_snapshots(folder)]
            subject = Subject(self.name, seed)
            return error_curve(
                subject, moments, self._views, configuration.evaluation, lambda share, text: None
            )

    def _moment(self, folder: Path, snapshot: Snapshot, method: str) -> Moment:
        opened = TrainedScene.open(folder, snapshot_weights(folder, snapshot))
        seconds = self.spent + Seconds(snapshot.wall_s, snapshot.cpu_s)
        renderer = TrainedRenderer(opened, self.clip)
        return Moment(method, "optimise_scene", snapshot.step, seconds.wall, seconds.cpu, renderer)

    def _optimise(
        self, configuration: Configuration, seed: int, folder: Path
    ) -> OptimisationResult:
        plan, canonical, sampling = self.plan, configuration.canonical, configuration.sampling
        canonical = canonical.model_copy(update={"finest_m": plan.no_finer(canonical.finest_m)})
        sampling = sampling.model_copy(update={"step_m": plan.no_finer(sampling.step_m)})
        shape = SceneShape(
            canonical=canonical,
            motion=configuration.motion,
            times=tuple(self.clip.times[~self.clip.held_out].tolist()),
            shell_width_m=plan.shell_width_m,
            inner_depth_m=sampling.inner_depth_m,
            step_m=sampling.step_m,
            residual=plan.needs("motion_residual"),
            light=plan.light,
        )
        learned = Learned(
            plan.needs("motion_residual"),
            plan.needs("motion_consensus"),
            plan.needs("appearance_codes"),
        )
        problem = shell_problem(
            self.start.density, self.start.motion, shape, learned, configuration.losses, seed
        )
        return optimise_scene(
            self.clip,
            problem,
            configuration.schedule.joint(),
            seed,
            self.spent,
            folder,
            lambda share, text: None,
            clock=TrainingClock(now=_cpu_now),
        )

    def _scores(self, renderer: TrainedRenderer) -> dict[str, float]:
        rows = score_views(Subject("", 0), "", self._views, renderer, self._evaluation)
        return {
            metric: float(np.mean([row.value for row in rows if row.metric == metric]))
            for metric in dict.fromkeys(row.metric for row in rows)
        }


def _cpu_now() -> Seconds:
    cpu_s = time.process_time()
    return Seconds(cpu_s, cpu_s)


def _prepare(scene: Scene, configuration: Configuration) -> Start:
    choose = configuration.plan
    given = ingest_meshes(scene)
    preparation = decide_preparation(inspect_scene(scene, given), choose)
    needed = {decision.name: decision.needed for decision in preparation}
    needs = ClipNeeds(
        background=needed["background_extraction"],
        masks=needed["mask_segmentation"],
        repeated_frames=choose.repeated_frames == "on",
    )
    clip = extract_clip(scene, configuration.capture, needs)
    bodies, usual = given.meshes, configuration.repair
    if needed["location_search"]:
        located = locate_body(clip, given, configuration.location_search)
        bodies = located.meshes
        usual = usual.after_search() if located.adopted else usual
    meshes, repair = repair_where_needed(
        clip, bodies, usual, choose.body_repair, lambda share, text: None
    )
    frames = decide_frames(0, len(clip.frames), choose)
    plan = plan_scene(clip, meshes, (*preparation, frames, repair), choose)
    density = pretrain_density(meshes, plan.canonical_frame, configuration.density)
    motion = fit_motion(
        clip,
        meshes,
        density,
        plan.shell_width_m,
        plan.needs("motion_fields"),
        configuration.motion,
    )
    return Start(clip, bodies, meshes, plan, density, motion)


def _views(scene: Scene, clip: Clip, configuration: Configuration) -> list[ScoredView]:
    others = extract_evaluation(scene, clip.frame_indices, configuration.capture)
    return few_views(scored_views(clip, others, configuration.evaluation), configuration.evaluation)
