"""Optimisations that start badly: rates, rays, pictures and seeds at their extremes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocoflow_core.capture.clip import Clip
from mocoflow_core.stability.case import Case, Found, require
from mocoflow_core.stability.toy_scene import (
    SCHEDULE,
    filmed,
    prepare,
    toy,
    train,
    undisturbed,
)
from mocoflow_core.stability.usable_scene import USABLE_DB, WHY_USABLE, lost
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.pace import Pace
from mocoflow_core.training.schedule import ScheduleConfig, band_alpha, rate_factor

SHORT = SCHEDULE.model_copy(update={"coarse_steps": 20, "fine_steps": 10})
_RATES = ("rate_features", "rate_networks", "rate_motion")


def _faster(factor: float) -> ScheduleConfig:
    usual = ScheduleConfig()
    return SCHEDULE.model_copy(update={name: getattr(usual, name) * factor for name in _RATES})


def _rate(factor: float) -> Found:
    """Far too high rates end in a usable scene with an event, or stop in words."""
    try:
        outcome = train(toy(), _faster(factor))
    except TrainingDiverged as stopped:
        require("schedule.rate" in str(stopped), f"does not say what to try: {stopped}")
        return Found(0.0, remark=f"stopped: {stopped}")
    require(factor < 100 or bool(outcome.events), "a run that went astray says nothing")
    require(factor > 4 or not outcome.events, f"a healthy run is disturbed: {outcome.events}")
    return lost(outcome, outcome.events)


def _rays(count: float) -> Found:
    schedule = SHORT.model_copy(update={"rays": int(count)})
    outcome = train(toy(), schedule)
    require(not outcome.events, f"a healthy run is disturbed: {outcome.events}")
    return Found(0.0, (*outcome.weights, outcome.psnr), f"{outcome.psnr:.1f} dB")


def _seed(seed: float) -> Found:
    outcome = undisturbed(int(seed))
    require(not outcome.events, f"a healthy run is disturbed: {outcome.events}")
    return Found(abs(outcome.psnr - undisturbed(0).psnr), outcome.weights, f"{outcome.psnr:.1f} dB")


def _strange(clip: Clip, kind: str) -> Clip:
    """All frames alike: one colour, the background alone, or nobody in any mask."""
    frames, masks = np.array(clip.frames), np.array(clip.masks)
    if kind == "background alone":
        frames[:] = clip.background
        masks[:] = False
    elif kind == "nobody in any mask":
        masks[:] = False
    else:
        frames[:] = {"black": 0, "white": 255, "grey": 127}[kind]
    return replace(clip, frames=frames, masks=masks)


def _pictures(kind: str) -> Found:
    """Nothing can be learned, and nothing may break."""
    clip, meshes, _ = filmed()
    outcome = train(prepare(_strange(clip, kind), meshes), SHORT)
    return Found(0.0, (*outcome.weights, outcome.psnr), f"{outcome.psnr:.1f} dB")


def _no_steps(steps: float) -> Found:
    """Schedules of no step, one step, one part only: rates and bands stay in their ranges."""
    count = int(steps)
    off = 0.0
    for step in {0, count // 2, max(count - 1, 0)}:
        done = Pace(count).share(step, 0.0)
        factor = rate_factor(done, 0.1)
        for coarse_share in (0.0, 0.5, 1.0):
            bands = band_alpha(done, coarse_share, 8)
            off = max(off, -bands, bands - 8.0, factor - 1.0, 0.1 - factor)
    schedule = SHORT.model_copy(update={"coarse_steps": count, "fine_steps": 0})
    weights = train(toy(), schedule).weights if count < 10 else ()
    return Found(max(off, 0.0), weights)


CASES = (
    Case(
        "learning_rate",
        "steps so long that they leave every minimum",
        "times the default",
        (1.0, 4.0, 10.0, 100.0, 1e4, 1e8),
        "the undisturbed scene, unseen views",
        _rate,
        USABLE_DB,
        "dB",
        f"{WHY_USABLE}; the guard must have brought it back, or have stopped in words",
        quick=False,
    ),
    Case(
        "rays_per_step",
        "a gradient from one ray, which may miss everything",
        "rays",
        (1.0, 2.0, 3.0, 7.0),
        "thirty steps, finite weights, no event",
        _rays,
        0.0,
        "",
        "only finiteness counts: so few rays teach nothing in thirty steps",
        quick=False,
    ),
    Case(
        "seeds",
        "another start, other rays",
        "seed",
        (0.0, 1.0, 2.0),
        "the scene of seed 0, unseen views",
        _seed,
        1.0,
        "dB",
        "120 steps of 96 rays: seeds differ by half a decibel, twice that is a fault",
        quick=False,
    ),
    Case(
        "pictures_without_content",
        "no texture, no person, no mask: nothing to be learned from",
        "pictures",
        ("black", "white", "grey", "background alone", "nobody in any mask"),
        "thirty steps, finite weights",
        _pictures,
        0.0,
        "",
        "only finiteness counts: there is no right answer",
        quick=False,
    ),
    Case(
        "length_of_schedule",
        "a schedule of no step divides by its length",
        "steps",
        (0.0, 1.0, 2.0, 1e6),
        "rates between their first and last, bands between none and all",
        _no_steps,
        1e-12,
        "",
        "rounding of a power in float64",
    ),
)
