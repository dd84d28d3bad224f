"""What one of two ranks does in the tests: train the toy scene, to its end or until killed."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import torch
from safetensors.torch import load_file

from mocoflow_core.training.batches import Batch
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.optimise_scene import optimise_scene
from mocoflow_core.training.ranks import SeveralRanks
from mocoflow_core.training.schedule import ScheduleConfig
from tests.toy_training import SCHEDULE, Prepared, prepare, problem_of, silent, train
from tests.training.slow_clock import SlowClock

CAREFUL = SCHEDULE.model_copy(update={"checkpoint_every_s": 1e-9})

here = cache(prepare)  # a rank prepares a scene once


def train_here(
    scene: Path,
    workspace: Path,
    schedule: ScheduleConfig = SCHEDULE,
    seconds_per_look: tuple[float, float] | None = None,
    spoilt: int | None = None,
):
    """Train as one of two ranks: the result, and what its weights add up to.

    The second rank is given a folder of its own, and a spoilt one's losses are no numbers.
    """
    prepared, ranks = here(scene), SeveralRanks()
    clock = TrainingClock()
    if seconds_per_look:
        clock = TrainingClock(now=SlowClock(per_look=seconds_per_look[ranks.rank]))
    problem = problem_of(prepared, ranks=ranks)
    if ranks.rank == spoilt:
        losses_of = problem.objective
        spoiling = lambda *given: {n: v * torch.nan for n, v in losses_of(*given).items()}  # noqa: E731
        problem = replace(problem, objective=spoiling)
    folder = workspace if ranks.is_first else workspace.with_name("second")
    result = optimise_scene(
        prepared.clip, problem, schedule, 0, Seconds(), folder, silent, clock=clock
    )
    return asdict(result), digest(problem.field.state_dict())


def digest(weights: dict[str, torch.Tensor]) -> str:
    content = b"".join(weights[name].numpy().tobytes() for name in sorted(weights))
    return hashlib.sha256(content).hexdigest()


def parameters(folder: Path) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


def killed_here(scene: Path, workspace: Path) -> None:
    """Train as one of two ranks until the tenth step, with a checkpoint of each."""
    prepared = here(scene)
    problem = problem_of(prepared, ranks=SeveralRanks())
    losses_of, calls = problem.objective, iter(range(11))  # the first one tells the start's losses

    def killed(batch: Batch, generator: torch.Generator) -> dict[str, torch.Tensor]:
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return losses_of(batch, generator)

    problem = replace(problem, objective=killed)
    with suppress(KeyboardInterrupt):
        optimise_scene(prepared.clip, problem, CAREFUL, 0, Seconds(), workspace, silent)


def killed_alone(prepared: Prepared, workspace: Path) -> None:
    def killed(fraction: float, text: str) -> None:
        raise KeyboardInterrupt

    with suppress(KeyboardInterrupt):
        train(prepared, workspace, schedule=CAREFUL, progress=killed)
