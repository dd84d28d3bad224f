"""A scene of capsules, taken through the stages up to the optimisation, in a second or two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import CaptureConfig, extract_clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.motion_residual import ResidualConfig
from mocoflow_core.fields.scene_shape import MotionConfig, SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.rendering.shell_scene import ShellScene
from mocoflow_core.rendering.shell_space import ShellSpace
from mocoflow_core.synthetic.toy import ToyConfig, write_toy_scene
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.fit_motion import MotionStart, fit_motion
from mocoflow_core.training.optimise_scene import OptimisationResult, optimise_scene, unwatched
from mocoflow_core.training.pretrain_density import DensityConfig, pretrain_density
from mocoflow_core.training.problem import Learned, Problem, shell_problem
from mocoflow_core.training.ranks import ALONE, Ranks
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import Snapshot

SHELL_M = 0.06
MOTION = MotionConfig(residual=ResidualConfig(hidden=16))
SAMPLING = SamplingConfig(step_m=0.03)
LOSSES = LossConfig(consensus_points=32)
SCHEDULE = ScheduleConfig(
    coarse_steps=15, fine_steps=10, rays=48, threads=1, checkpoint_every_s=1e6
)
CAPTURE = CaptureConfig(holdout_every=3)


def silent(fraction: float, what: str) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """What the optimisation starts from."""

    clip: Clip
    meshes: MeshSequence
    density: CanonicalDensity
    motion: MotionStart
    shape: SceneShape

    @cached_property
    def space(self) -> ShellSpace:
        return ShellSpace(self.shape, self.density, self.motion.controls)

    def field(self, seed: int = 0) -> HybridField:
        torch.manual_seed(seed)
        return self.space.build()

    def scene(self, field: HybridField | None = None) -> ShellScene:
        """At the training frames."""
        return self.space.at_training_frames(field or self.field(), self.motion.body)


def write_toy(folder: Path) -> Path:
    """Six frames of 32 x 32 pixels; two of them are held out under CAPTURE."""
    write_toy_scene(folder, ToyConfig(frames=6, cameras=2))
    return folder


def prepare(scene: Path) -> Prepared:
    clip = extract_clip(open_scene(scene), CAPTURE)
    meshes = MeshSequence.load(scene / "meshes.npz")
    density = pretrain_density(meshes, int(clip.frame_indices[0]), DensityConfig(spacing_m=0.03))
    shape = SceneShape(
        canonical=CanonicalConfig(finest_m=0.03, levels=2, channels=4, hidden=16),
        motion=MOTION,
        times=tuple(clip.times[~clip.held_out].tolist()),
        shell_width_m=SHELL_M,
        inner_depth_m=SAMPLING.inner_depth_m,
        step_m=SAMPLING.step_m,
    )
    motion = fit_motion(clip, meshes, density, SHELL_M, True, MOTION)
    return Prepared(clip, meshes, density, motion, shape)


def problem_of(
    prepared: Prepared,
    seed: int = 0,
    learned: Learned | None = None,
    losses: LossConfig | None = None,
    ranks: Ranks = ALONE,
) -> Problem:
    return shell_problem(
        prepared.density,
        prepared.motion,
        prepared.shape,
        learned or Learned(),
        losses or LOSSES,
        seed,
        ranks,
    )


def train(
    prepared: Prepared,
    workspace: Path,
    seed: int = 0,
    schedule: ScheduleConfig = SCHEDULE,
    progress: Callable[[float, str], None] = silent,
    learned: Learned | None = None,
    losses: LossConfig | None = None,
    before: Seconds | None = None,
    watch: Callable[[list[Snapshot]], None] = unwatched,
    clock: TrainingClock | None = None,
) -> OptimisationResult:
    return optimise_scene(
        prepared.clip,
        problem_of(prepared, seed, learned, losses),
        schedule,
        seed,
        before or Seconds(),
        workspace,
        progress,
        watch,
        clock,
    )


def pixels_of(clip: Clip) -> int:
    return int(np.prod(clip.frames.shape[1:3]))
