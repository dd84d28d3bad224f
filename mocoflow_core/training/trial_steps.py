"""Steps without effect: how long one takes, and how large the losses are before the first."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.training.batches import PixelSource
from mocoflow_core.training.objective import Objective, sum_of
from mocoflow_core.training.ranks import Ranks
from mocoflow_core.training.schedule import ScheduleConfig

# That tell how large the losses are at the start: of a single frame they may be next to nothing.
_START_RAYS = 1024
_START_FRAMES = 16


@dataclass(frozen=True, eq=False)
class TrialSteps:
    """What a run looks at before its first step."""

    field: SceneField
    objective: Objective
    pixels: PixelSource
    schedule: ScheduleConfig
    ranks: Ranks

    def step(self) -> None:
        """The work of a step without its effect."""
        generator = torch.Generator().manual_seed(0)
        batch = self.pixels.batch(self.schedule.rays, self.schedule.frames_per_step, generator)
        sum_of(self.objective(batch.own_part(self.ranks), generator)).backward()
        self.field.zero_grad(set_to_none=True)

    @torch.no_grad()
    def loss(self) -> float:
        """What the losses sum to, over enough rays and frames."""
        generator = torch.Generator().manual_seed(0)
        frames = self.schedule.frames_per_step
        batches = -(-_START_FRAMES // frames)
        rays = -(-max(self.schedule.rays, _START_RAYS) // batches)
        found = 0.0
        for _ in range(batches):
            own = self.pixels.batch(rays, frames, generator).own_part(self.ranks)
            found += float(self.ranks.total(sum_of(self.objective(own, generator))))
        return found / batches
