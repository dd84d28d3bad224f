"""How many steps, with which rates, how coarse: what changes while the optimisation goes on."""

from __future__ import annotations

from pydantic import Field, JsonValue

from mocoflow_core.configuration import ConfigurationPart


class ScheduleConfig(ConfigurationPart):
    """Steps and rates. A step is one update of the optimiser, on however many devices."""

    coarse_steps: int = Field(500, ge=0, description="N2: joint, bands fading in")
    fine_steps: int = Field(250, ge=0, description="N3: joint, all bands on")
    # Half the rays at twice the rates, with cells of 14 mm instead of 10, reach the error of before
    # in two thirds of the time: benchmarks/work_precision.md.
    rays: int = Field(384, ge=1, description="rays of one step")
    frames_per_step: int = Field(4, ge=1, description="frames that the rays of a step come from")
    rate_features: float = Field(4e-2, gt=0, description="feature grids")
    rate_networks: float = Field(6e-3, gt=0, description="networks of the canonical field")
    rate_motion: float = Field(1e-3, gt=0, description="residual motion and its codes")
    final_rate: float = Field(0.1, gt=0, le=1, description="last rate as a share of the first")
    budget_s: float | None = Field(None, gt=0, description="seconds of the training clock in all")
    # On synthetic scenes twice the steps or twice the rays brought 0.06 dB and -0.2 dB at unseen
    # views, four times the steps -0.2 dB: a larger budget is given back.
    longest: float = Field(
        1.0, ge=1, description="a budget may lengthen the schedule to so many times its steps"
    )
    fewest_steps: int = Field(
        300, ge=1, description="a budget that leaves fewer steps than this gets fewer rays a step"
    )
    fewest_rays: int = Field(192, ge=1, description="of one step, under any budget")
    until_train_psnr: float | None = Field(
        None, gt=0, le=99, description="dB of held-out train pixels at which the run may stop"
    )
    until_every: int = Field(25, ge=1, description="steps from one look at that score to the next")
    held_out_pixels: int = Field(
        2048, ge=1, description="pixels of the train camera, kept out of training, for train_psnr"
    )
    checkpoint_every_s: float = Field(5.0, gt=0, description="a kill loses at most this much work")
    threads: int | None = Field(None, ge=1, description="forced; otherwise chosen by a probe")

    def deciding(self) -> dict[str, JsonValue]:
        """The fields that decide where a run ends, and not only how it gets there."""
        return self.model_dump(mode="json", exclude={"threads", "checkpoint_every_s"})

    @property
    def joint_steps(self) -> int:
        return self.coarse_steps + self.fine_steps

    @property
    def coarse_share(self) -> float:
        """The part of the schedule in which the bands fade in."""
        return self.coarse_steps / max(self.joint_steps, 1)


def rate_factor(share: float, final_rate: float) -> float:
    """Exponential decay from 1 at the first step (share 0) to ``final_rate`` at the last (1)."""
    return final_rate**share


def band_alpha(share: float, coarse_share: float, bands: int) -> float:
    """``bands * n / N`` over the coarse part of the schedule, then all bands.

    Source: MoCo-Flow sec. 3.3.
    """
    return bands * min(share / coarse_share, 1.0) if coarse_share > 0 else float(bands)
