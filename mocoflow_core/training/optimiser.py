"""Adam, with a rate of its own for each kind of parameter."""

from __future__ import annotations

import torch

from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.training.schedule import ScheduleConfig

_BETA1 = 0.9


def build_optimiser(field: SceneField, schedule: ScheduleConfig) -> torch.optim.Optimizer:
    """Adam over features, networks and motion, at the schedule's first rates."""
    rates = (schedule.rate_features, schedule.rate_networks, schedule.rate_motion)
    groups = [
        {"params": parameters, "lr": rate}
        for parameters, rate in zip(field.rate_groups(), rates, strict=True)
    ]
    betas = (_BETA1, schedule.adam_beta2)
    return torch.optim.Adam(groups, betas=betas, eps=schedule.adam_epsilon, fused=True)
