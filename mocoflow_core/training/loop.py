"""The optimisation loop: steps, guard, checkpoints, snapshots, clock."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from pathlib import Path

import torch
from safetensors.torch import save_file

from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.threads import choose_threads, torch_threads
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.checkpoint import (
    Progress,
    load_checkpoint,
    remove_checkpoint,
    save_checkpoint,
)
from mocoflow_core.training.clock import Seconds, TrainingClock, snapshot_due
from mocoflow_core.training.guard import Guard
from mocoflow_core.training.objective import Objective
from mocoflow_core.training.schedule import ScheduleConfig, band_alpha, rate_factor

_REMEMBER_EVERY = 50  # steps between the states that the guard can go back to
_ALLOWED_EVENTS = 20
_START_RAYS = 1024  # that tell how large the losses are at the start
_PROBE_STEPS = 20  # steps that measure the speed before a budget fixes their number


class TrainingRun:
    """One optimisation, started or resumed."""

    def __init__(
        self,
        field: SceneField,
        objective: Objective,
        pixels: TrainingPixels,
        schedule: ScheduleConfig,
        seed: int,
        before: Seconds,
        workspace: Path,
        progress: Callable[[float, str], None],
    ) -> None:
        self.field = field
        self.objective = objective
        self.pixels = pixels
        self.schedule = schedule
        self.before = before
        self.workspace = workspace
        self.report = progress
        self.generator = torch.Generator().manual_seed(seed)
        self.optimiser = _optimiser(field, schedule)
        self._base_rates = [group["lr"] for group in self.optimiser.param_groups]
        self._losses: deque[dict[str, float]] = deque(maxlen=50)
        restored = load_checkpoint(workspace, field, self.optimiser, self.generator)
        if restored is None:
            threads = choose_threads(schedule.threads, self._try_out)
            self.progress = Progress(threads, schedule.joint_steps)
        else:
            self.progress = restored
            self.progress.tries += 1
        self.guard = Guard(field, self.optimiser, _ALLOWED_EVENTS, schedule.rays)
        self.guard.expect(self._start_loss())
        self.guard.events = self.progress.events
        self.guard.rate_scale = self.progress.rate_scale

    def run(self) -> None:
        """All remaining steps."""
        with torch_threads(self.progress.threads):
            self._steps()

    @property
    def recent_losses(self) -> dict[str, float]:
        """Means of the weighted losses over the last steps."""
        if not self._losses:
            return {}
        return {n: sum(e[n] for e in self._losses) / len(self._losses) for n in self._losses[-1]}

    def forget_checkpoint(self) -> None:
        remove_checkpoint(self.workspace)

    def _steps(self) -> None:
        clock = TrainingClock(self.progress.elapsed)
        saved_at = clock.read().wall
        while self.progress.step < self.progress.steps:
            self._step(self.progress.step)
            self.progress.step += 1
            self.progress.elapsed = clock.read()
            if self.progress.step == _PROBE_STEPS:
                self._fit_budget()
            if snapshot_due(self.progress.snapshots, self.progress.elapsed.wall, 0.0):
                self._snapshot()
            if self.progress.elapsed.wall - saved_at >= self.schedule.checkpoint_every_s:
                saved_at = self.progress.elapsed.wall
                self._save()
            if self.progress.step % 10 == 0:
                done = self.progress.step / self.progress.steps
                self.report(done, f"step {self.progress.step} of {self.progress.steps}")
        self._go_back_if_bad()
        self._snapshot()

    def _try_out(self) -> None:
        """The work of a step without its effect: for choosing the number of threads."""
        generator = torch.Generator().manual_seed(0)
        batch = self.pixels.batch(self.schedule.rays, self.schedule.frames_per_step, generator)
        torch.stack(list(self.objective(batch, generator).values())).sum().backward()
        self.optimiser.zero_grad(set_to_none=True)

    @torch.no_grad()
    def _start_loss(self) -> float:
        """What the losses sum to before anything is learned, over enough rays to rely on."""
        generator = torch.Generator().manual_seed(0)
        rays = max(self.schedule.rays, _START_RAYS)
        batch = self.pixels.batch(rays, self.schedule.frames_per_step, generator)
        return float(torch.stack(list(self.objective(batch, generator).values())).sum())

    def _step(self, step: int) -> None:
        schedule, steps = self.schedule, self.progress.steps
        bands = self.field.motion.residual_to_canonical.encoding.bands
        share = schedule.coarse_steps / max(schedule.joint_steps, 1)
        self.field.anneal(band_alpha(step, steps, share, bands))
        factor = rate_factor(step, steps, schedule.final_rate) * self.guard.rate_scale
        for group, base in zip(self.optimiser.param_groups, self._base_rates, strict=True):
            group["lr"] = base * factor
        batch = self.pixels.batch(schedule.rays, schedule.frames_per_step, self.generator)
        terms = self.objective(batch, self.generator)
        self.optimiser.zero_grad(set_to_none=True)
        torch.stack(list(terms.values())).sum().backward()
        problem = self.pixels.problem(batch) or self.guard.problem(terms)
        # These weights have just given finite losses and gradients; the next ones are unknown.
        if problem is None and step % _REMEMBER_EVERY == 0:
            problem = self.guard.settle()
        if problem is not None:
            self._refuse(problem)
            return
        self.optimiser.step()
        self._losses.append({name: float(value.detach()) for name, value in terms.items()})

    def _refuse(self, problem: str) -> None:
        self.guard.refuse(self.progress.step, problem)
        self.progress.rate_scale = self.guard.rate_scale

    def _go_back_if_bad(self) -> None:
        """The last update has not been seen by a step: nothing bad may be kept."""
        self.optimiser.zero_grad(set_to_none=True)
        problem = self.guard.problem({}) or self.guard.decline()
        if problem is not None:
            self._refuse(problem)

    def _fit_budget(self) -> None:
        """Shorten the schedule so that the training clock ends within the budget."""
        if self.schedule.budget_s is None:
            return
        left = self.schedule.budget_s - (self.before + self.progress.elapsed).wall
        per_step = self.progress.elapsed.wall / self.progress.step
        possible = self.progress.step + max(int(left / per_step), 1)
        self.progress.steps = min(self.progress.steps, possible)

    def _snapshot(self) -> None:
        if self.guard.problem({}) is not None:
            return  # the next step refuses it
        folder = self.workspace / "snapshots"
        folder.mkdir(exist_ok=True)
        step = self.progress.step
        save_file(self.field.state_dict(), folder / f"{step:06d}.safetensors")
        self.progress.snapshots += 1
        index = folder / "snapshots.json"
        entries = json.loads(index.read_text()) if index.exists() else []
        entries = [entry for entry in entries if entry["step"] < step]
        elapsed = self.progress.elapsed
        entries.append({"step": step, "wall_s": elapsed.wall, "cpu_s": elapsed.cpu})
        index.write_text(json.dumps(entries))

    def _save(self) -> None:
        if self.guard.problem({}) is not None:
            return  # the next step refuses it
        save_checkpoint(self.workspace, self.progress, self.field, self.optimiser, self.generator)


def _optimiser(field: SceneField, schedule: ScheduleConfig) -> torch.optim.Optimizer:
    features = list(field.canonical.tables)
    networks = [p for n, p in field.canonical.named_parameters() if not n.startswith("tables.")]
    motion = [*field.motion.parameters(), field.appearance]
    groups = [
        {"params": features, "lr": schedule.rate_features},
        {"params": networks, "lr": schedule.rate_networks},
        {"params": motion, "lr": schedule.rate_motion},
    ]
    return torch.optim.Adam(groups, betas=(0.9, 0.99), eps=1e-10, fused=True)
