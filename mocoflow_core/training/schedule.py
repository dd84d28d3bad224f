"""How many steps, with which rates, how coarse: what changes while the optimisation goes on."""

from __future__ import annotations

from pydantic import Field, JsonValue

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.training.precision import Precision


class ScheduleConfig(ConfigurationPart):
    """Steps and rates. A step is one update of the optimiser, on however many devices."""

    pretrain_steps: int = Field(0, ge=0, description="density on images of the canonical mesh")
    fit_steps: int = Field(0, ge=0, description="N1: motion, with density frozen")
    coarse_steps: int = Field(500, ge=0, description="N2: joint, bands fading in")
    fine_steps: int = Field(250, ge=0, description="N3: joint, all bands on")
    scale: float = Field(1.0, gt=0, description="all four counts of steps times this")
    first_bands: float = Field(
        0.0, ge=0, le=1, description="share of bands that are on at first; 1: no coarse-to-fine"
    )
    last_bands: float = Field(1.0, ge=0, le=1, description="share of bands that are on at last")
    # Half the rays at twice the rates, with cells of 14 mm instead of 10, reach the error of before
    # in two thirds of the time: benchmarks/work-precision-2026-11-24/.
    rays: int = Field(384, ge=1, description="rays of one step")
    frames_per_step: int = Field(4, ge=1, description="frames that the rays of a step come from")
    rate_features: float = Field(4e-2, gt=0, description="feature grids")
    rate_networks: float = Field(6e-3, gt=0, description="networks of the canonical field")
    rate_motion: float = Field(1e-3, gt=0, description="residual motion and its codes")
    adam_beta2: float = Field(0.99, ge=0, lt=1, description="decay of Adam's second moment")
    adam_epsilon: float = Field(1e-10, gt=0, description="Adam's smallest divisor")
    final_rate: float = Field(0.1, gt=0, le=1, description="last rate as a share of the first")
    # Up to 0.1 dB at unseen views for 1 % of a step: benchmarks/falling_curves.md.
    averaging: float = Field(
        0.97, ge=0, lt=1, description="of the weights' running mean, kept by a step; 0: no mean"
    )
    precision: Precision = Field(
        "float32",
        description="of the networks' products; bfloat16 is for GPUs that are made for it",
    )
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

    def pretraining(self) -> ScheduleConfig:
        """The first stage alone, with a decay of rates of its own."""
        return self._stage(self._scaled(self.pretrain_steps), 0)

    def fitting(self) -> ScheduleConfig:
        """The second stage alone; rates decay over it and the third together."""
        last = {"final_rate": self.final_rate**self._fit_share}
        return self._stage(self._scaled(self.fit_steps), 0).model_copy(update=last)

    def joint(self) -> ScheduleConfig:
        """The third stage alone: the one that a budget or a score to reach may end."""
        rates = ("rate_features", "rate_networks", "rate_motion")
        decayed = self.final_rate**self._fit_share
        own = {name: getattr(self, name) * decayed for name in rates}
        own["final_rate"] = self.final_rate / decayed
        for name in ("last_bands", "budget_s", "until_train_psnr"):
            own[name] = getattr(self, name)
        steps = (self._scaled(self.coarse_steps), self._scaled(self.fine_steps))
        return self._stage(*steps).model_copy(update=own)

    def without_steps(self) -> ScheduleConfig:
        """A stage that is left out."""
        return self._stage(0, 0)

    def _stage(self, coarse: int, fine: int) -> ScheduleConfig:
        """Only these steps, at the bands of the start, for as long as they take."""
        counts = {"pretrain_steps": 0, "fit_steps": 0, "coarse_steps": coarse, "fine_steps": fine}
        plain = {"scale": 1.0, "last_bands": self.first_bands, "budget_s": None}
        return self.model_copy(update=counts | plain | {"until_train_psnr": None})

    def _scaled(self, steps: int) -> int:
        return round(self.scale * steps)

    @property
    def _fit_share(self) -> float:
        """The part of the second and third stage's steps that belongs to the second."""
        return self.fit_steps / max(self.fit_steps + self.joint_steps, 1)

    @property
    def coarse_share(self) -> float:
        """The part of the schedule in which the bands fade in."""
        return self.coarse_steps / max(self.joint_steps, 1)


def rate_factor(share: float, final_rate: float) -> float:
    """Exponential decay from 1 at the first step (share 0) to ``final_rate`` at the last (1)."""
    return final_rate**share


def band_alpha(
    share: float, coarse_share: float, bands: int, first: float = 0.0, last: float = 1.0
) -> float:
    """``bands * n / N`` over the coarse part of the schedule, then all bands.

    Args:
        first, last: shares of the bands before and after the coarse part.

    Source: MoCo-Flow sec. 3.3.
    """
    done = min(share / coarse_share, 1.0) if coarse_share > 0 else 1.0
    return bands * (first + (last - first) * done)
