"""Numbers that are none, planted in a frame, a ray, a weight, a gradient and the optimiser.

Each ends in a usable scene and an event, or stops with what, where and what to try.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch
from torch import Tensor

from mocoflow_core.geometry.rays import Rays
from mocoflow_core.stability.case import Case, Found, require
from mocoflow_core.stability.toy_scene import SCHEDULE, toy, train
from mocoflow_core.stability.usable_scene import USABLE_DB, WHY_USABLE, lost
from mocoflow_core.training.batches import Batch, TrainingPixels
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.loop import TrainingRun

AT_STEPS = (0.0, 60.0, SCHEDULE.joint_steps - 1.0)

Planting = Callable[[TrainingRun, Batch], Batch]


class PlantedPixels(TrainingPixels):
    """A run's own pixels, with a fault planted when the batch of one step is drawn."""

    def __init__(self, run: TrainingRun, at: int, plant: Planting) -> None:
        self.__dict__.update(run.pixels.__dict__)
        self.run = run
        self.at = at
        self.plant = plant

    def batch(self, rays: int, frames: int, generator: torch.Generator) -> Batch:
        drawn = super().batch(rays, frames, generator)
        return self.plant(self.run, drawn) if self.run.progress.step == self.at else drawn


def _planted(at: float, plant: Planting, named: str) -> Found:
    """Train with a fault planted at a step; the event names what was met."""

    def disturb(run: TrainingRun) -> None:
        run.pixels = PlantedPixels(run, int(at), plant)

    try:
        outcome = train(toy(), disturb=disturb)
    except TrainingDiverged as stopped:
        require(named in str(stopped) and "schedule" in str(stopped), f"says too little: {stopped}")
        return Found(0.0, remark=f"stopped: {stopped}")
    require(any(named in event for event in outcome.events), f"in silence: {outcome.events}")
    return lost(outcome, outcome.events)


def _in_frame(run: TrainingRun, batch: Batch) -> Batch:
    rgb = batch.rgb.clone()
    rgb[0, 0] = torch.nan
    return replace(batch, rgb=rgb)


def _table(run: TrainingRun) -> Tensor:
    """The coarsest feature table."""
    return run.field.rate_groups().features[0]


def _in_ray(run: TrainingRun, batch: Batch) -> Batch:
    directions = batch.rays.directions.clone()
    directions[0, 0] = torch.nan
    return replace(batch, rays=Rays(batch.rays.origins, directions))


def _in_weight(run: TrainingRun, batch: Batch) -> Batch:
    with torch.no_grad():
        _table(run)[0, 0] = torch.nan
    return batch


def _in_gradient(run: TrainingRun, batch: Batch) -> Batch:
    """One entry of one gradient, once."""

    def plant(gradient: Tensor) -> Tensor:
        handle.remove()
        spoilt = gradient.clone()
        spoilt[0, 0] = torch.nan
        return spoilt

    handle = _table(run).register_hook(plant)
    return batch


def _in_optimiser(run: TrainingRun, batch: Batch) -> Batch:
    """A moment that is no number spoils the weights with the next update."""
    run.optimiser.state[_table(run)]["exp_avg"][0, 0] = torch.nan
    return batch


def _every_time(run: TrainingRun, batch: Batch) -> Batch:
    """A frame that brings no numbers whenever it is drawn."""
    assert isinstance(run.pixels, TrainingPixels)
    spoilt = run.pixels.frames.float()
    spoilt[5] = torch.nan
    run.pixels.frames = spoilt
    return batch


def _planting(
    name: str, stiff: str, plant: Planting, named: str, at_steps: tuple[float, ...] = AT_STEPS
) -> Case[float]:
    return Case(
        name,
        stiff,
        "planted at step",
        at_steps,
        "the undisturbed scene, unseen views; an event names it",
        lambda at: _planted(at, plant, named),
        USABLE_DB,
        "dB",
        WHY_USABLE,
        quick=False,
    )


CASES = (
    _planting("nan_in_a_frame", "a colour that is no number", _in_frame, "frame "),
    _planting("nan_in_a_ray", "a sample that is nowhere", _in_ray, "rays"),
    _planting("nan_in_a_weight", "a weight that is no number", _in_weight, "weight canonical"),
    _planting("nan_in_a_gradient", "a gradient that is no number", _in_gradient, "gradient of"),
    _planting(
        "nan_in_the_optimiser",
        "a moment that spoils the weights one update later, after the last look at them",
        _in_optimiser,
        "canonical.tables.0",
        AT_STEPS[1:],
    ),
    _planting(
        "nan_in_every_draw_of_a_frame",
        "refusing steps does not remove the cause",
        _every_time,
        "frame 5",
        (0.0, 60.0),
    ),
)
