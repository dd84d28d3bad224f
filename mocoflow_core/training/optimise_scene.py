"""Stage 3: all fields together, coarse to fine, against the train camera's pixels."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from safetensors.torch import save_file

from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.checkpoint import Progress
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.held_out import HeldOutPixels, HeldOutScore, draw_held_out
from mocoflow_core.training.loop import TrainingRun
from mocoflow_core.training.problem import Problem
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import Snapshot, read_snapshots

RESULT = "result.json"


@dataclass(frozen=True)
class OptimisationResult:
    """What the run report needs to know about the optimisation."""

    steps: int  # that were made
    rays: int  # of one step
    threads: int
    tries: int
    wall_s: float  # of this stage, all tries
    cpu_s: float
    events: list[dict[str, object]]
    losses: dict[str, float]  # mean over the last steps
    train_psnr: float | None  # dB, of the held-out pixels at the end
    held_out: str  # what these are
    warnings: tuple[str, ...]

    @classmethod
    def from_json(cls, text: str) -> OptimisationResult:
        values = json.loads(text)
        return cls(**{**values, "warnings": tuple(values["warnings"])})


def unwatched(curve: list[Snapshot]) -> None:
    """Nobody looks at the curve while it grows."""


def optimise_scene(
    clip: Clip,
    problem: Problem,
    schedule: ScheduleConfig,
    seed: int,
    before: Seconds,
    workspace: Path,
    progress: Callable[[float, str], None],
    watch: Callable[[list[Snapshot]], None] = unwatched,
    clock: TrainingClock | None = None,
) -> OptimisationResult:
    """Train the fields of a scene; resume from the workspace's checkpoint if there is one.

    Writes the trained scene (``model.safetensors`` and what else is needed to open it),
    ``snapshots/%06d.safetensors`` at geometric times with ``snapshots.json``, and ``result.json``.

    Args:
        problem: what is learned and from what; its field is trained in place. Where several ranks
            share its rays, each calls this with the same arguments and gets the same result; the
            first alone writes, reports and is watched.
        before: training clock of the stages so far.
        workspace: folder that survives a kill.
        watch: is given all snapshots so far whenever there is a new one.
        clock: of this stage; it must have been started just now.

    Raises:
        InputError: a train_psnr to reach, on a scene without any mask to measure it on.
            A checkpoint that was made with other settings.
        TrainingDiverged: after too many non-finite steps.

    Source: MoCo-Flow sec. 3.4, third stage.
    """
    clock, ranks = clock or TrainingClock(), problem.ranks
    with clock.paused():
        held_out = draw_held_out(clip, schedule.held_out_pixels)
        _require_pixels_to_score(held_out, schedule)
        score = None
        if held_out is not None and ranks.is_first:
            score = HeldOutScore.prepare(clip, held_out, problem.space, problem.field)
    pixels = TrainingPixels(clip, problem.scene, held_out)
    ranks.first(lambda: _begin(problem, workspace))
    run = TrainingRun(
        problem,
        pixels,
        schedule,
        seed,
        before,
        workspace,
        progress,
        watch,
        score,
        clock,
    )
    run.run()
    return OptimisationResult.from_json(
        ranks.first(lambda: _finish(run, before, held_out, problem.faults()))
    )


def _begin(problem: Problem, workspace: Path) -> None:
    workspace.mkdir(parents=True, exist_ok=True)
    problem.space.save(workspace)


def _finish(
    run: TrainingRun, before: Seconds, held_out: HeldOutPixels | None, faults: tuple[str, ...]
) -> str:
    """Write the trained weights and the result, and drop the checkpoint."""
    save_file(run.field.state_dict(), run.workspace / "model.safetensors")
    result = json.dumps(asdict(_result(run, before, held_out, faults)))
    (run.workspace / RESULT).write_text(result)
    run.forget_checkpoint()
    return result


def _require_pixels_to_score(held_out: HeldOutPixels | None, schedule: ScheduleConfig) -> None:
    if held_out is None and schedule.until_train_psnr is not None:
        raise InputError(
            "a train camera with masks for --until train_psnr",
            "no mask that shows the person",
            "Leave --until out, or add masks.",
        )


def _result(
    run: TrainingRun, before: Seconds, held_out: HeldOutPixels | None, faults: tuple[str, ...]
) -> OptimisationResult:
    progress = run.progress
    train_psnr = read_snapshots(run.workspace)[-1].train_psnr
    return OptimisationResult(
        progress.step,
        progress.rays,
        progress.threads,
        progress.tries,
        progress.elapsed.wall,
        progress.elapsed.cpu,
        [asdict(event) for event in progress.events],
        run.recent_losses,
        train_psnr,
        held_out.description if held_out else "",
        (*_warnings(progress, train_psnr, before, run.schedule), *faults),
    )


def _warnings(
    progress: Progress, train_psnr: float | None, before: Seconds, schedule: ScheduleConfig
) -> tuple[str, ...]:
    """What the run could not keep of what was asked for."""
    budget_s, target = schedule.budget_s, schedule.until_train_psnr
    warnings = []
    if progress.step == 0 and budget_s is not None:
        warnings.append(
            f"the scene is untrained: its preparation took {(before + progress.elapsed).wall:.1f} s"
            f" of a budget of {budget_s:g} s"
        )
    if target is not None and not progress.reached:
        warnings.append(
            f"train_psnr is {train_psnr:.1f} dB, not {target:g}, at the end of the schedule"
        )
    return tuple(warnings)
