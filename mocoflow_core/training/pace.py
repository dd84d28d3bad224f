"""How far the optimisation has come: a share of its steps, or of the time that a budget leaves.

Rates and bands depend on this share alone, so that their schedule completes however fast the
machine is, also when it gets slower or faster on the way.
"""

from __future__ import annotations

from dataclasses import dataclass

from mocoflow_core.training.schedule import ScheduleConfig


@dataclass(frozen=True)
class Pace:
    """When the optimisation ends.

    Without a budget the steps alone decide: the same values give the same parameters. With one,
    time decides, and the parameters depend on the machine's speed.
    """

    steps: int
    available_s: float | None = None  # of the optimisation's clock; None: as long as steps take
    start_s: float = 0.0  # of that clock, when the first step began

    def share(self, step: int, elapsed_s: float) -> float:
        """How far a step that starts now is, 0 at the first to 1 at the last."""
        by_steps = step / max(self.steps - 1, 1)
        if self.available_s is None:
            return min(by_steps, 1.0)
        left_s = self.available_s - self.start_s
        by_time = (elapsed_s - self.start_s) / left_s if left_s > 0 else 1.0
        return min(max(by_steps, by_time), 1.0)

    def is_over(self, step: int, elapsed_s: float, step_s: float) -> bool:
        """Whether all steps are done, or too little time is left for another.

        A step that would end after the budget is taken if more than half of it lies within.

        Args:
            step_s: what the last step took.
        """
        if step >= self.steps:
            return True
        return self.available_s is not None and elapsed_s + 0.5 * step_s >= self.available_s


def plan_pace(schedule: ScheduleConfig, before_s: float, start_s: float) -> Pace:
    """The schedule's steps; or as many as fit into the budget, up to a longest schedule.

    Args:
        before_s: training clock when the optimisation began to get ready.
        start_s: seconds after that, when the first step began.
    """
    if schedule.budget_s is None:
        return Pace(schedule.joint_steps)
    longest = round(schedule.longest * schedule.joint_steps)
    return Pace(longest, max(schedule.budget_s - before_s, 0.0), start_s)


def plan_rays(schedule: ScheduleConfig, left_s: float, step_s: float) -> int:
    """Rays of one step: fewer where a budget would otherwise leave few steps.

    Args:
        left_s: seconds that the budget leaves for steps.
        step_s: seconds of a step with all rays on this machine.
    """
    rays = round(schedule.rays * left_s / (step_s * schedule.fewest_steps))
    return max(min(rays, schedule.rays), min(schedule.fewest_rays, schedule.rays))
