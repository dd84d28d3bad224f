"""The optimisation loop: steps, guard, checkpoints, snapshots, clock."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor

from mocoflow_core.threads import choose_threads, seconds_of, torch_threads
from mocoflow_core.training.averaged_weights import AveragedWeights
from mocoflow_core.training.batches import PixelSource
from mocoflow_core.training.checkpoint import (
    Progress,
    Restored,
    read_checkpoint,
    remove_checkpoint,
    restore_checkpoint,
    save_checkpoint,
)
from mocoflow_core.training.clock import Seconds, TrainingClock, snapshot_due
from mocoflow_core.training.guard import Guard
from mocoflow_core.training.objective import sum_of
from mocoflow_core.training.optimiser import build_optimiser
from mocoflow_core.training.pace import plan_pace, plan_rays
from mocoflow_core.training.precision import in_precision
from mocoflow_core.training.problem import Problem
from mocoflow_core.training.ranks import Ranks
from mocoflow_core.training.schedule import ScheduleConfig, band_alpha, rate_factor
from mocoflow_core.training.snapshots import Snapshot, forget_snapshots, keep_snapshot
from mocoflow_core.training.trial_steps import TrialSteps

_REMEMBER_EVERY = 50  # steps between the states that the guard can go back to
_ALLOWED_EVENTS = 20

Score = Callable[[], float]
Chosen = TypeVar("Chosen", int, int | None)


def unreported(share: float, text: str) -> None:
    """The first rank reports for all."""


class TrainingRun:
    """One optimisation, started or resumed.

    ``score`` is ``train_psnr`` of the held-out pixels, asked while the clock stands still; each
    snapshot hands the curve so far to ``watch``. Without a watcher none are kept. Of several ranks
    each runs one; all take the same decisions, as these depend on joint losses and on the first
    rank's clock, and only the first one scores, writes and reports.
    """

    def __init__(
        self,
        problem: Problem,
        pixels: PixelSource,
        schedule: ScheduleConfig,
        seed: int,
        before: Seconds,
        workspace: Path,
        progress: Callable[[float, str], None],
        watch: Callable[[list[Snapshot]], None] | None,
        score: Score | None,
        clock: TrainingClock,
    ) -> None:
        self.field = field = problem.field
        self.ranks = ranks = problem.ranks
        self.objective = in_precision(problem.objective, schedule.precision, ranks.device)
        self.from_scratch = problem.from_scratch
        self.made_with = {**problem.settings, "schedule": schedule.deciding(), "seed": seed}
        self.pixels = pixels
        self.schedule = schedule
        self.before = before
        self.workspace = workspace
        self.report = progress if ranks.is_first else unreported
        self.watch = watch
        self.score = score
        self.clock = clock
        self.generator = torch.Generator().manual_seed(seed)
        # Torch loads its compiler with the first optimiser, for seconds: an import, not work.
        with clock.paused():
            self.optimiser = build_optimiser(field, schedule)
        self.average = AveragedWeights(field, schedule.averaging)
        self._base_rates = [group["lr"] for group in self.optimiser.param_groups]
        self._losses: deque[dict[str, float]] = deque(maxlen=50)
        restored = self._restored()
        self.progress = restored.progress if restored else self._first_start()
        self.guard = Guard(
            field,
            self.optimiser,
            _ALLOWED_EVENTS,
            self.progress.rays,
            schedule.frames_per_step,
        )
        self.guard.expect(self.progress.best)
        self.guard.events = self.progress.events
        self.guard.rate_scale = self.progress.rate_scale
        if restored:
            self._resume(restored)
        ranks.first(lambda: forget_snapshots(workspace, self.progress.step))
        pace = plan_pace(schedule, before.wall, self.progress.started_s)
        self.pace = replace(pace, steps=self.progress.steps)

    def _restored(self) -> Restored | None:
        """What the first rank's workspace holds of an earlier try, of however many ranks."""
        content = self.ranks.first_bytes(lambda: read_checkpoint(self.workspace))
        if not content:
            return None
        parts = (self.field, self.optimiser, self.generator)
        return restore_checkpoint(content, self.workspace, self.made_with, *parts)

    def _resume(self, restored: Restored) -> None:
        """Go on as if there had been no kill, but for the clock, which counts both tries."""
        progress = restored.progress
        progress.tries += 1
        if self.ranks.is_first:
            self.clock.go_on_from(progress.elapsed)
        progress.elapsed = self._now()
        self._losses.extend(progress.losses)
        self.guard.restore(restored.good, progress.best, progress.recent)
        self.average.restore(restored.means, progress.averaged)

    def run(self) -> None:
        """All remaining steps."""
        self._shared = self.ranks.share(self.field, self.objective)
        with torch_threads(self._threads(self.progress.threads)):
            self._steps()

    @property
    def recent_losses(self) -> dict[str, float]:
        """Means of the weighted losses over the last steps."""
        if not self._losses:
            return {}
        return {n: sum(e[n] for e in self._losses) / len(self._losses) for n in self._losses[-1]}

    def forget_checkpoint(self) -> None:
        remove_checkpoint(self.workspace)

    def _now(self) -> Seconds:
        """What the training clock shows, the same on all ranks."""
        return self.ranks.seconds(self.clock.read())

    def _threads(self, chosen: Chosen) -> Chosen | int:
        """Several ranks on a machine are its threads already."""
        return chosen if self.ranks.count == 1 else 1

    def _first_start(self) -> Progress:
        """What a resumed run must find again: threads, steps and rays."""
        schedule = self.schedule
        trial = TrialSteps(self.field, self.objective, self.pixels, schedule, self.ranks)
        threads = choose_threads(self._threads(schedule.threads), trial.step)
        rays = schedule.rays
        left_s = self._left_s()
        if left_s is not None and left_s > 0:
            with torch_threads(threads):
                step_s = seconds_of(trial.step)
            rays = self.ranks.first(lambda: plan_rays(schedule, left_s, step_s))
        # An empty picture is close to a white wall; the first fog that is learned is not.
        best = math.inf if self.from_scratch else trial.loss()
        now = self._now()
        steps = plan_pace(schedule, self.before.wall, now.wall).steps
        return Progress(threads, steps, rays, started_s=now.wall, elapsed=now, best=best)

    def _left_s(self) -> float | None:
        """What remains of a budget."""
        if self.schedule.budget_s is None:
            return None
        return self.schedule.budget_s - (self.before + self._now()).wall

    def _steps(self) -> None:
        progress = self.progress
        saved_s = progress.elapsed.wall
        step_s = 0.0
        while not self._is_over(step_s):
            self._step(self.pace.share(progress.step, progress.elapsed.wall))
            progress.step += 1
            started_s, progress.elapsed = progress.elapsed.wall, self._now()
            step_s = progress.elapsed.wall - started_s
            self._look(progress.elapsed.wall)
            if progress.elapsed.wall - saved_s >= self.schedule.checkpoint_every_s:
                saved_s = progress.elapsed.wall
                self._save()
            if progress.step % 10 == 0:
                self.report(self.pace.share(progress.step, progress.elapsed.wall), self._text())
        self._go_back_if_bad()
        self._snapshot()
        self.average.take()

    def _is_over(self, step_s: float) -> bool:
        progress = self.progress
        over = self.pace.is_over(progress.step, progress.elapsed.wall, step_s)
        return over or progress.reached

    def _text(self) -> str:
        of = f" of {self.pace.steps}" if self.pace.available_s is None else ""
        return f"step {self.progress.step}{of}"

    def _step(self, share: float) -> None:
        """One update, at a share of the schedule between 0 and 1."""
        schedule, step = self.schedule, self.progress.step
        limits = (schedule.first_bands, schedule.last_bands)
        self.field.anneal(band_alpha(share, schedule.coarse_share, self.field.bands, *limits))
        factor = rate_factor(share, schedule.final_rate) * self.guard.rate_scale
        for group, base in zip(self.optimiser.param_groups, self._base_rates, strict=True):
            group["lr"] = base * factor
        batch = self.pixels.batch(self.progress.rays, schedule.frames_per_step, self.generator)
        own_terms = self._shared(batch.own_part(self.ranks), self.generator)
        self.optimiser.zero_grad(set_to_none=True)
        # Gradients become means over ranks; the losses are sums over them.
        (sum_of(own_terms) * self.ranks.count).backward()
        terms = _joint(own_terms, self.ranks)
        problem = self.pixels.problem(batch) or self.guard.problem(terms)
        # These weights have just given finite losses and gradients; the next ones are unknown.
        if problem is None and step % _REMEMBER_EVERY == 0:
            problem = self.guard.settle()
        if problem is not None:
            self._refuse(problem)
            return
        self.optimiser.step()
        self.average.update()
        self._losses.append({name: float(value.detach()) for name, value in terms.items()})

    def _refuse(self, problem: str) -> None:
        self.guard.refuse(self.progress.step, problem)
        self.average.restart()

    def _go_back_if_bad(self) -> None:
        """The last update has not been seen by a step: nothing bad may be kept."""
        self.optimiser.zero_grad(set_to_none=True)
        problem = self.guard.problem({}) or self.guard.decline()
        if problem is not None:
            self._refuse(problem)

    def _look(self, wall_s: float) -> None:
        """Keep a snapshot at geometric times; see at certain steps whether the score is reached."""
        target, step = self.schedule.until_train_psnr, self.progress.step
        if target is not None and step % self.schedule.until_every == 0:
            self.progress.reached = (self._train_psnr() or 0.0) >= target
        if snapshot_due(self.progress.snapshot_s, wall_s, self.before.wall):
            self._snapshot()

    def _snapshot(self) -> None:
        if self.watch is None or self.guard.problem({}) is not None:
            return  # a bad state is refused by the next step
        self.progress.snapshot_s = self.progress.elapsed.wall
        psnr = self._train_psnr()
        with self.clock.paused():
            self.ranks.first(lambda: self._keep(psnr))

    def _keep(self, psnr: float | None) -> None:
        step, now = self.progress.step, self.progress.elapsed
        with self.average.shown():
            curve = keep_snapshot(self.workspace, self.field, step, now, psnr)
        if self.watch is not None:
            self.watch(curve)

    def _train_psnr(self) -> float | None:
        with self.clock.paused(), self.average.shown():
            return self.ranks.first(lambda: None if self.score is None else self.score())

    def _save(self) -> None:
        if self.guard.problem({}) is not None:
            return  # the next step refuses it
        progress, guard = self.progress, self.guard
        progress.best, progress.recent = guard.best, list(guard.recent)
        progress.rate_scale = guard.rate_scale
        progress.losses = list(self._losses)
        progress.averaged = self.average.steps
        parts = (self.field, self.optimiser, self.generator)
        states = (guard.good_state(), self.average.state())
        save = partial(save_checkpoint, self.workspace, self.made_with, progress, *parts, *states)
        self.ranks.first(save)


def _joint(terms: dict[str, Tensor], ranks: Ranks) -> dict[str, Tensor]:
    """The losses of all rays."""
    summed = ranks.total(torch.stack([value.detach() for value in terms.values()]))
    return dict(zip(terms, summed, strict=True))
