"""Stage 3: all fields together, coarse to fine, against the train camera's pixels."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from safetensors.torch import save_file

from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.motion_hybrid import Moments
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.checkpoint import Progress
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.fit_motion import MotionStart
from mocoflow_core.training.loop import TrainingRun
from mocoflow_core.training.objective import Objective
from mocoflow_core.training.schedule import ScheduleConfig


@dataclass(frozen=True)
class Learned:
    """Which parts of the field this scene needs; the plan decides."""

    motion_residual: bool = True
    consensus: bool = True
    appearance_codes: bool = True


@dataclass(frozen=True)
class OptimisationResult:
    """What the run report needs to know about the optimisation."""

    steps: int
    threads: int
    tries: int
    wall_s: float  # of this stage, all tries
    cpu_s: float
    events: list[dict[str, object]]
    losses: dict[str, float]  # mean over the last steps


def optimise_scene(
    clip: Clip,
    density: CanonicalDensity,
    motion: MotionStart,
    shape: SceneShape,
    learned: Learned,
    losses: LossConfig,
    sampling: SamplingConfig,
    schedule: ScheduleConfig,
    seed: int,
    before: Seconds,
    workspace: Path,
    progress: Callable[[float, str], None],
) -> OptimisationResult:
    """Train the fields of a scene; resume from the workspace's checkpoint if there is one.

    Writes the trained scene (``model.safetensors``, ``shape.json``, the density and the controls),
    ``snapshots/%06d.safetensors`` at geometric times with ``snapshots.json``, and ``result.json``.

    Args:
        before: training clock of the stages so far.
        workspace: folder that survives a kill.

    Raises:
        TrainingDiverged: after too many non-finite steps.

    Source: MoCo-Flow sec. 3.4, third stage.
    """
    torch.manual_seed(seed)
    field = shape.build(density.prior())
    _freeze_what_is_not_needed(field, learned)
    body = motion.body
    moments = Moments(body, field.motion.codes)
    weights = losses if learned.consensus else losses.model_copy(update={"consensus_weight": 0.0})
    objective = Objective(
        field, moments, weights, sampling, shape.shell_width_m, learned.motion_residual
    )
    pixels = TrainingPixels(clip, body, shape.shell_width_m)
    workspace.mkdir(parents=True, exist_ok=True)
    write_scene_parts(workspace, shape, density, motion)
    run = TrainingRun(field, objective, pixels, schedule, seed, before, workspace, progress)
    run.run()
    save_file(field.state_dict(), workspace / "model.safetensors")
    result = _result(run.progress, run.recent_losses)
    (workspace / "result.json").write_text(json.dumps(asdict(result)))
    run.forget_checkpoint()
    return result


def write_scene_parts(
    folder: Path, shape: SceneShape, density: CanonicalDensity, motion: MotionStart
) -> None:
    """Everything besides the weights that a trained scene needs to be opened alone."""
    (folder / "shape.json").write_text(shape.model_dump_json(indent=1))
    density.save(folder)
    motion.controls.save(folder)


def _freeze_what_is_not_needed(field: SceneField, learned: Learned) -> None:
    field.motion.requires_grad_(learned.motion_residual)
    field.appearance.requires_grad_(learned.appearance_codes)


def _result(progress: Progress, losses: dict[str, float]) -> OptimisationResult:
    return OptimisationResult(
        progress.steps,
        progress.threads,
        progress.tries,
        progress.elapsed.wall,
        progress.elapsed.cpu,
        [asdict(event) for event in progress.events],
        losses,
    )
