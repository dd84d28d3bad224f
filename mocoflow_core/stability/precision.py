"""The toy scene in float64, float32, and under autocast to bfloat16 and float16."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any

import torch
from torch import Tensor

from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.geometry.grid import SparseGrids
from mocoflow_core.geometry.rays import Rays
from mocoflow_core.stability.case import Case, Found
from mocoflow_core.stability.toy_scene import Outcome, toy, train
from mocoflow_core.training.batches import Batch, TrainingPixels
from mocoflow_core.training.loop import TrainingRun
from mocoflow_core.training.objective import Objective, ShellObjective
from mocoflow_core.training.precision import ShortProducts

KINDS = ("float32", "autocast bfloat16", "autocast float16")
AUTOCAST = {"autocast bfloat16": torch.bfloat16, "autocast float16": torch.float16}


class DoublePixels(TrainingPixels):
    """The same batches in float64."""

    def __init__(self, own: TrainingPixels) -> None:
        self.__dict__.update(own.__dict__)

    def batch(self, rays: int, frames: int, generator: torch.Generator) -> Batch:
        return _doubled_batch(super().batch(rays, frames, generator))


def _double(value: Any) -> Any:  # noqa: ANN401 - tensors of any type, and what holds them
    if isinstance(value, Rays):
        return Rays(_double(value.origins), _double(value.directions))
    return value.double() if isinstance(value, Tensor) and value.is_floating_point() else value


def _doubled_batch(batch: Batch) -> Batch:
    return replace(batch, **{f.name: _double(getattr(batch, f.name)) for f in fields(batch)})


def _doubled_grids(grids: SparseGrids) -> SparseGrids:
    return replace(grids, origin=grids.origin.double())


def _doubled_body(body: BodyMotion) -> BodyMotion:
    return BodyMotion(
        body.times,
        _doubled_grids(body.observed_grids),
        body.observed_maps.double(),
        body.observed_distance.double(),
        body.observed_facing.double(),
        _doubled_grids(body.canonical_grid),
        body.canonical_maps.double(),
    )


def _to_double(field: HybridField, objective: ShellObjective) -> None:
    """Weights, look-up tables and lattices in float64, in place."""
    field.double()
    field.canonical.grids = [_doubled_grids(grids) for grids in field.canonical.grids]
    objective.scene.body = _doubled_body(objective.scene.body)


def _in_double(run: TrainingRun) -> None:
    objective = _losses(run)
    _to_double(objective.scene.field, objective)
    assert isinstance(run.pixels, TrainingPixels)
    run.pixels = DoublePixels(run.pixels)


def _losses(run: TrainingRun) -> ShellObjective:
    assert isinstance(run.objective, ShellObjective)
    return run.objective


def _short(own: ShellObjective, kind: str) -> ShortProducts:
    return ShortProducts(own, torch.device("cpu"), AUTOCAST[kind])


@cache
def _trained(kind: str) -> Outcome:
    def disturb(run: TrainingRun) -> None:
        if kind == "float64":
            _in_double(run)
        elif kind in AUTOCAST:
            run.objective = _short(_losses(run), kind)

    return train(toy(), disturb=disturb)


def _final_error(kind: str) -> Found:
    outcome, exact = _trained(kind), _trained("float64")
    words = f"{outcome.psnr:.2f} dB against {exact.psnr:.2f} dB. {'; '.join(outcome.events)}"
    return Found(abs(outcome.psnr - exact.psnr), outcome.weights, words)


def _gradients(kind: str) -> dict[str, Tensor]:
    """Gradients of one and the same step at the start, in float64."""
    prepared = toy()
    field = prepared.field()
    own = prepared.objective(field)
    objective: Objective = own
    # The heads that start at zero would hide what lies before them.
    with torch.no_grad():
        for name, weight in field.named_parameters():
            if not weight.any():
                generator = torch.Generator().manual_seed(len(name))
                weight.add_(1e-2 * torch.randn(weight.shape, generator=generator))
    field.anneal(2.0)
    batch = prepared.pixels().batch(256, 4, torch.Generator().manual_seed(0))
    if kind == "float64":
        _to_double(field, own)
        batch = _doubled_batch(batch)
    elif kind in AUTOCAST:
        objective = _short(own, kind)
    terms = objective(batch, torch.Generator().manual_seed(0))
    torch.stack(list(terms.values())).sum().backward()
    return {n: p.grad.double() for n, p in field.named_parameters() if p.grad is not None}


def _gradient_difference(kind: str) -> Found:
    """The worst relative difference of a parameter's gradient, and whose it is."""
    found, exact = _gradients(kind), _gradients("float64")
    off = {n: float((found[n] - exact[n]).norm() / exact[n].norm()) for n in exact}
    worst = max(off, key=lambda name: off[name])
    return Found(off[worst], tuple(found.values()), f"worst: {worst}")


def _gradient_bound(kind: str) -> float:
    return 1e-3 if kind == "float32" else 1.0


CASES = (
    Case(
        "gradient",
        "short numbers through rendering, consensus and their gradients",
        "numbers",
        KINDS,
        "the same step in float64, relative, worst parameter",
        _gradient_difference,
        _gradient_bound,
        "relative",
        "float32: points 3 m away are rounded by 4e-7 m and the density's edge is 6 mm wide: 1e-4, "
        "ten times for sums that cancel; autocast: a difference shorter than the gradient still "
        "leads downhill, and final_error tells what it costs",
        quick=False,
    ),
    Case(
        "final_error",
        "rounding in every one of 120 steps",
        "numbers",
        KINDS,
        "the same run in float64, unseen views",
        _final_error,
        1.0,
        "dB",
        "two seeds differ by as much: a shorter type may cost no more than another seed",
        quick=False,
    ),
)
