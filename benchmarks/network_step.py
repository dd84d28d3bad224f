"""One optimisation step of the paper's networks: everything evaluated, and what can be felt alone.

    python -m benchmarks.network_step [--steps 3] [--scene turn] [--out benchmarks/network_step.md]

Both ways draw the same rays of the same scene, with densities as pretraining leaves them: solid in
the body, empty around it. They are fitted to the canonical mesh's inside here, in seconds instead
of hours, because only where density is decides what a step costs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from benchmarks.plain_networks import PlainBoxScene, plain_losses
from mocoflow_core.body.signed_distance import signed_distance_lattice
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import extract_clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.fields.network_field import NetworkField
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior
from mocoflow_core.io.machine import describe_machine
from mocoflow_core.presets import Configuration, paper
from mocoflow_core.rendering.box_scene import BoxScene
from mocoflow_core.rendering.box_space import BoxSpace
from mocoflow_core.training.batches import Batch, TrainingPixels
from mocoflow_core.training.network_objective import NetworkObjective
from mocoflow_core.training.network_stages import network_space

Step = Callable[[torch.Generator], dict[str, Tensor]]
_FIT_STEPS, _FIT_POINTS = 300, 2048


class Measured(NamedTuple):
    """Median CPU seconds of a step, and the losses of the first one."""

    cpu_s: float
    losses: dict[str, float]


def main() -> None:
    arguments = _arguments()
    torch.set_num_threads(1)
    chosen, space, field, clip, faces = _prepare(Path(arguments.scene))
    _fit_density(field, space, faces)
    times = torch.from_numpy(clip.times[~clip.held_out])
    boxes = space.boxes.at(times)
    samples = (chosen.box.coarse_samples, chosen.box.fine_samples)
    ours, plain = BoxScene(field, boxes, *samples), PlainBoxScene(field, boxes, *samples)
    pixels = TrainingPixels(clip, ours)
    rows = []
    for name, hits_alone in (("all rays meet the box", True), ("rays of the whole image", False)):
        batch = _batch(pixels, chosen.schedule.rays, hits_alone)
        objective = NetworkObjective(ours, chosen.losses, consensus=True)
        slow = _measure(field, partial(plain_losses, plain, chosen.losses, batch), 1)
        fast = _measure(field, partial(objective, batch), arguments.steps)
        rows.append(_row(name, slow, fast))
        print(rows[-1], flush=True)
    text = _document(rows, arguments, describe_machine())
    Path(arguments.out).write_text(text)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", required=True, help="scene folder")
    parser.add_argument("--steps", type=int, default=3, help="of which the median is taken")
    parser.add_argument("--out", default="benchmarks/network_step.md")
    return parser.parse_args()


def _prepare(folder: Path) -> tuple[Configuration, BoxSpace, NetworkField, Clip, np.ndarray]:
    chosen = paper()
    scene = open_scene(folder)
    clip, meshes = extract_clip(scene, chosen.capture), ingest_meshes(scene).meshes
    first = int(clip.frame_indices[0])
    space = network_space(clip, meshes, first, True, "frame", chosen.networks, chosen.box)
    torch.manual_seed(0)
    field = space.build()
    field.anneal(0.5 * field.bands)
    return chosen, space, field, clip, meshes.faces


def _fit_density(field: NetworkField, space: BoxSpace, faces: np.ndarray) -> None:
    """Solid inside the mesh, below zero outside, in both networks."""
    origin, lattice = signed_distance_lattice(space.canonical_vertices, faces, 0.03, 0.2)
    distance = SignedDistancePrior(torch.from_numpy(lattice), torch.from_numpy(origin), 0.03)
    generator = torch.Generator().manual_seed(0)
    networks = (field.coarse, field.fine)
    optimiser = torch.optim.Adam([p for n in networks for p in n.density_parameters()], lr=1e-3)
    vertices = torch.from_numpy(space.canonical_vertices)
    for _ in range(_FIT_STEPS):
        near = vertices[torch.randint(len(vertices), (_FIT_POINTS // 2,), generator=generator)]
        near = near + 0.1 * torch.randn(near.shape, generator=generator)
        around = 2.0 * torch.rand(_FIT_POINTS // 2, 3, generator=generator) - 1.0
        points = torch.cat([near, field.centre + field.radius * around])
        goal = torch.tanh(-distance(points) / 0.03)
        encoded = field.encoding(field.to_local(points))
        raw = [network.density_head(network.trunk(encoded))[:, 0] for network in networks]
        optimiser.zero_grad()
        sum(((found - goal) ** 2).mean() for found in raw).backward()
        optimiser.step()
    for network in networks:  # as dense as skin: opaque within centimetres
        with torch.no_grad():
            network.density_head.weight.mul_(10.0)
            network.density_head.bias.mul_(10.0)


def _batch(pixels: TrainingPixels, rays: int, hits_alone: bool) -> Batch:
    batch = pixels.batch(20 * rays, 1, torch.Generator().manual_seed(0))
    hits = batch.far > batch.near
    rows = hits.nonzero()[:rays, 0] if hits_alone else torch.arange(rays)
    parts = {n: getattr(batch, n)[rows] for n in vars(batch) if n != "rays"}
    return replace(batch, rays=batch.rays.select(rows), **parts)


def _measure(field: NetworkField, step: Step, steps: int) -> Measured:
    optimiser = torch.optim.Adam(field.parameters(), lr=0.0, fused=True)
    seconds, losses = [], {}
    for _ in range(steps):
        start = time.process_time()
        terms = step(torch.Generator().manual_seed(1))
        optimiser.zero_grad()
        torch.stack(list(terms.values())).sum().backward()
        optimiser.step()
        seconds.append(time.process_time() - start)
        losses = {name: float(value.detach()) for name, value in terms.items()}
    return Measured(median(seconds), losses)


def _row(name: str, slow: Measured, fast: Measured) -> str:
    apart = max(abs(fast.losses[n] / value - 1.0) for n, value in slow.losses.items())
    ratio = fast.cpu_s / slow.cpu_s
    return f"| {name} | {slow.cpu_s:.1f} | {fast.cpu_s:.2f} | {ratio:.2f} | {apart:.0e} |"


def _document(rows: list[str], arguments: argparse.Namespace, machine: dict) -> str:
    command = f"python -m benchmarks.network_step --scene {Path(arguments.scene).name}"
    return _TEXT.format(
        command=command,
        date=time.strftime("%d %B %Y"),
        cores=machine["cores"],
        model=machine["model"],
        rows="\n".join(rows),
    )


_TEXT = """# One step of the paper's networks

384 rays, 64 + 128 samples, 8 x 256 networks, photometric loss and consensus: forward, backward
and Adam. Median CPU seconds, one thread. "Plain" evaluates every ray, sample and colour, and the
consensus everywhere; "ours" only what a loss or a gradient can feel.

`{command}`, {date}, {cores} cores, {model}:

| rays | plain, CPU s | ours, CPU s | ratio | losses apart, relative |
|---|---|---|---|---|
{rows}

The authors' published code was measured once at 27 CPU seconds for such a step.
"""


if __name__ == "__main__":
    main()
