"""The toy scene on which whole stages are tried: five capsules, prepared in a second or two."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import CaptureConfig, extract_clip, extract_evaluation
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.fields.body_lattices import BodyMotionConfig
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.motion_residual import ResidualConfig
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.fields.scene_shape import MotionConfig, SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.metrics.score import on_white
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.rendering.shell_scene import ShellScene
from mocoflow_core.rendering.shell_space import ShellSpace
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.synthetic.toy import ToyConfig, write_toy_scene
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.fit_motion import MotionStart, fit_motion
from mocoflow_core.training.loop import TrainingRun
from mocoflow_core.training.objective import ShellObjective
from mocoflow_core.training.pretrain_density import DensityConfig, pretrain_density
from mocoflow_core.training.problem import Learned, shell_problem
from mocoflow_core.training.schedule import ScheduleConfig

SHELL_M = 0.06
SAMPLING = SamplingConfig(step_m=0.03)
LOSSES = LossConfig(consensus_points=64)
# Few steps, and so rates that are four times the usual ones.
SCHEDULE = ScheduleConfig(
    coarse_steps=60,
    fine_steps=60,
    rays=96,
    rate_features=8e-2,
    rate_networks=1.2e-2,
    rate_motion=4e-3,
    threads=1,
    checkpoint_every_s=1e6,
)
MOTION = MotionConfig(
    body=BodyMotionConfig(node_spacing_m=0.06, control_spacing_m=0.06),
    residual=ResidualConfig(hidden=16),
)
RECORDING = ToyConfig(frames=16, cameras=4, turn_deg=360.0)
SCORED_VIEWS = 4


@dataclass(frozen=True, eq=False)
class Prepared:
    """What an optimisation starts from."""

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

    def scene(self, field: HybridField) -> ShellScene:
        """At the training frames."""
        return self.space.at_training_frames(field, self.motion.body)

    def pixels(self) -> TrainingPixels:
        return TrainingPixels(self.clip, self.scene(self.field()))

    def objective(self, field: HybridField) -> ShellObjective:
        return ShellObjective(self.scene(field), LOSSES, motion_learned=True)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What an optimisation left."""

    field: SceneField
    events: list[str]
    psnr: float  # dB, at views of another camera, over the union of both masks

    @property
    def weights(self) -> tuple[Tensor, ...]:
        return tuple(self.field.state_dict().values())


@cache
def recorded(configuration: ToyConfig = RECORDING) -> Path:
    """The folder of a toy scene; it goes with the process."""
    folder = Path(tempfile.mkdtemp(prefix="mocoflow-stability-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    write_toy_scene(folder / "scene", configuration)
    return folder / "scene"


@cache
def filmed(configuration: ToyConfig = RECORDING) -> tuple[Clip, MeshSequence, Clip]:
    """The train camera's clip, the exact meshes and what the other camera saw."""
    scene = open_scene(recorded(configuration))
    clip = extract_clip(scene, CaptureConfig())
    other, *_ = extract_evaluation(scene, clip.frame_indices, CaptureConfig())
    return clip, MeshSequence.load(scene.root / "meshes.npz"), other


@cache
def toy() -> Prepared:
    clip, meshes, _ = filmed()
    return prepare(clip, meshes)


def prepare(clip: Clip, meshes: MeshSequence) -> Prepared:
    """The stages between the meshes in the world and the optimisation."""
    density = pretrain_density(meshes, int(clip.frame_indices[0]), DensityConfig(spacing_m=0.04))
    shape = SceneShape(
        canonical=CanonicalConfig(finest_m=0.03, levels=2, channels=4, hidden=16),
        motion=MOTION,
        times=tuple(clip.times[~clip.held_out].tolist()),
        shell_width_m=SHELL_M,
        inner_depth_m=SAMPLING.inner_depth_m,
        step_m=SAMPLING.step_m,
    )
    return Prepared(
        clip, meshes, density, fit_motion(clip, meshes, density, SHELL_M, True, MOTION), shape
    )


def train(
    prepared: Prepared,
    schedule: ScheduleConfig = SCHEDULE,
    seed: int = 0,
    disturb: Callable[[TrainingRun], None] = lambda run: None,
    seen: ToyConfig = RECORDING,
) -> Outcome:
    """Run the training loop itself and score its result.

    Args:
        disturb: may change the run before its first step.
        seen: the recording whose other camera judges.

    Raises TrainingDiverged as the loop does.
    """
    problem = shell_problem(
        prepared.density, prepared.motion, prepared.shape, Learned(), LOSSES, seed
    )
    with tempfile.TemporaryDirectory() as folder:
        run = TrainingRun(
            problem,
            prepared.pixels(),
            schedule,
            seed,
            Seconds(),
            Path(folder),
            lambda fraction, text: None,
            lambda curve: None,
            None,
            TrainingClock(),
        )
        disturb(run)
        run.run()
    events = [f"step {event.step}: {event.what}" for event in run.progress.events]
    judged = prepared.field()
    judged.load_state_dict(problem.field.state_dict())  # in float32, whatever it was trained in
    return Outcome(problem.field, events, score(prepared, judged, filmed(seen)[2]))


@cache
def undisturbed(seed: int = 0) -> Outcome:
    """The toy scene as it comes out when nothing goes wrong."""
    return train(toy(), seed=seed)


def score(prepared: Prepared, field: HybridField, other: Clip) -> float:
    """Mean PSNR (dB) at views of another camera, on white, over the union of both masks."""
    scene = TrainedScene(prepared.space, field)
    rows = np.linspace(0, len(other.frames) - 1, SCORED_VIEWS).round().astype(int)
    found = []
    for row in rows:
        rgb, opacity = scene.render(other.camera, float(other.times[row]))
        truth = on_white(other.frames[row], other.masks[row])
        found.append(psnr(rgb, truth, other.masks[row] | (opacity > 0.5)))
    return float(np.mean(found))


def with_frames(clip: Clip, change: Callable[[np.ndarray], None]) -> Clip:
    """The clip with its frames (T, H, W, 3) changed in place by ``change``."""
    frames = np.array(clip.frames)
    change(frames)
    return replace(clip, frames=frames)


def with_masks(clip: Clip, change: Callable[[np.ndarray], None]) -> Clip:
    """The clip with its masks (T, H, W) changed in place by ``change``."""
    masks = np.array(clip.masks)
    change(masks)
    return replace(clip, masks=masks)
