"""How many steps, with which rates, how coarse: everything that changes with the step."""

from __future__ import annotations

from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart


class ScheduleConfig(ConfigurationPart):
    """Steps and rates. A step is one update of the optimiser, on however many devices."""

    coarse_steps: int = Field(500, ge=0, description="N2: joint, bands fading in")
    fine_steps: int = Field(250, ge=0, description="N3: joint, all bands on")
    rays: int = Field(768, ge=1, description="rays of one step")
    frames_per_step: int = Field(4, ge=1, description="frames that the rays of a step come from")
    rate_features: float = Field(2e-2, gt=0, description="feature grids")
    rate_networks: float = Field(3e-3, gt=0, description="networks of the canonical field")
    rate_motion: float = Field(1e-3, gt=0, description="residual motion and its codes")
    final_rate: float = Field(0.1, gt=0, le=1, description="last rate as a share of the first")
    budget_s: float | None = Field(None, gt=0, description="seconds of the training clock in all")
    checkpoint_every_s: float = Field(5.0, gt=0, description="a kill loses at most this much work")
    threads: int | None = Field(None, ge=1, description="forced; otherwise chosen by a probe")

    @property
    def joint_steps(self) -> int:
        return self.coarse_steps + self.fine_steps


def rate_factor(step: int, steps: int, final_rate: float) -> float:
    """Exponential decay from 1 at the first step to ``final_rate`` at the last."""
    return final_rate ** (step / max(steps - 1, 1))


def band_alpha(step: int, steps: int, coarse_share: float, bands: int) -> float:
    """``bands * n / N`` over the coarse part of the schedule, then all bands.

    Source: MoCo-Flow sec. 3.3.
    """
    coarse = coarse_share * steps
    return bands * min(step / coarse, 1.0) if coarse > 0 else float(bands)
