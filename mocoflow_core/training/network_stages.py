"""The paper's stages before the joint one: density on the mesh's images, motion on the mesh."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import JsonValue
from safetensors.torch import load_file, save_file

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.network_field import (
    NetworkField,
    NetworksConfig,
    box_of,
    density_parameters,
)
from mocoflow_core.fields.network_shape import NetworkShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.progress import Progress
from mocoflow_core.rendering.box_scene import BoxScene
from mocoflow_core.rendering.box_space import BoxSpace
from mocoflow_core.rendering.frame_box import BoxConfig, Follows, frame_boxes
from mocoflow_core.training.batches import PixelSource, TrainingPixels
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.fit_points import FitPoints
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.held_out import draw_held_out
from mocoflow_core.training.loop import TrainingRun
from mocoflow_core.training.mesh_views import MeshViews, MeshViewsConfig
from mocoflow_core.training.network_objective import NetworkObjective
from mocoflow_core.training.problem import Learned, Problem
from mocoflow_core.training.ranks import ALONE, Ranks
from mocoflow_core.training.schedule import ScheduleConfig

_WEIGHTS = "model.safetensors"
_RESULT = "stage.json"  # of a stage that was trained
_MOST_EMPTY = 0.5  # of the mesh's vertices, which lie on the surface itself


@dataclass(frozen=True)
class StageResult:
    """What a stage before the last one has to report."""

    steps: int
    threads: int
    tries: int
    events: list[dict[str, object]]
    losses: dict[str, float]  # means over the last steps

    def summary(self) -> dict[str, JsonValue]:
        """As an artifact carries it."""
        return {
            "steps": self.steps,
            "threads": self.threads,
            "tries": self.tries,
            "events": [str(event) for event in self.events],
            "losses": dict(self.losses),
        }


def pretrain_networks(
    clip: Clip,
    meshes: MeshSequence,
    canonical_frame: int,
    moves: bool,
    follows: Follows,
    networks: NetworksConfig,
    box: BoxConfig,
    views: MeshViewsConfig,
    schedule: ScheduleConfig,
    seed: int,
    workspace: Path,
    progress: Progress,
    clock: TrainingClock | None = None,
) -> StageResult:
    """Train the radiance networks on images of the canonical mesh, from all sides.

    Writes the scene's space and ``model.safetensors``. A schedule without steps leaves fresh
    weights: the ablation without initialisation.

    Args:
        canonical_frame: source number.
        moves: false: the canonical body stands in every frame.
        schedule: of this stage alone.

    Raises:
        TrainingDiverged: no density is left on the body, or too many bad steps.

    Source: MoCo-Flow sec. 3.4, first stage.
    """
    torch.manual_seed(seed)
    space = network_space(clip, meshes, canonical_frame, moves, follows, networks, box)
    field = space.build()
    workspace.mkdir(parents=True, exist_ok=True)
    space.save(workspace)
    if schedule.joint_steps == 0:
        return _untrained(field, workspace)
    field.moves = False
    for parameter in (*field.motion_parameters(), field.appearance):
        parameter.requires_grad_(False)
    row = int(np.flatnonzero(clip.frame_indices == canonical_frame)[0])
    scene = space.at(field, torch.tensor([clip.times[row]]))
    losses, learned = LossConfig(silhouette_weight=0.0), Learned(False, False, False)
    objective = NetworkObjective(scene, losses, consensus=False)
    pixels = MeshViews(space.canonical_vertices, meshes.faces, scene, views)
    problem = Problem(space, field, scene, objective, _settings(space, learned, losses))
    result = _train(problem, pixels, schedule, seed, workspace, progress, clock)
    require_density(field, space.canonical_vertices)
    return result


def fit_networks(
    clip: Clip,
    meshes: MeshSequence,
    pretrained: Path,
    learned: Learned,
    losses: LossConfig,
    schedule: ScheduleConfig,
    seed: int,
    workspace: Path,
    progress: Progress,
    clock: TrainingClock | None = None,
) -> StageResult:
    """Fit both motion networks and the colours, density frozen.

    Writes the scene's space and ``model.safetensors``. Source: MoCo-Flow sec. 3.4, second stage.

    Args:
        pretrained: folder of ``pretrain_networks``.
        schedule: of this stage alone.
    """
    space, field, scene = _opened(pretrained, clip, learned, seed)
    workspace.mkdir(parents=True, exist_ok=True)
    space.save(workspace)
    if schedule.joint_steps == 0:
        return _untrained(field, workspace)
    for parameter in density_parameters(field):
        parameter.requires_grad_(False)
    training = meshes.at(clip.frame_indices[~clip.held_out])
    points = FitPoints(
        training.vertices, training.faces, space.canonical_vertices, scene.boxes, losses
    )
    consensus = learned.consensus and field.moves
    objective = NetworkObjective(scene, losses, consensus, points if field.moves else None)
    pixels = TrainingPixels(clip, scene, draw_held_out(clip, schedule.held_out_pixels))
    settings = _settings(space, learned, losses)
    fitting = Problem(space, field, scene, objective, settings)
    return _train(fitting, pixels, schedule, seed, workspace, progress, clock)


def network_problem(
    folder: Path,
    clip: Clip,
    learned: Learned,
    losses: LossConfig,
    seed: int,
    ranks: Ranks = ALONE,
) -> Problem:
    """The joint optimisation of all networks, from the weights that a stage before has left.

    Raises FileNotFoundError where a part is missing: nothing starts from scratch in silence.
    """
    space, field, scene = _opened(folder, clip, learned, seed, ranks)
    consensus = learned.consensus and field.moves
    objective = NetworkObjective(scene, losses, consensus, ranks=ranks)
    settings = _settings(space, learned, losses)
    from_scratch = not (folder / _RESULT).exists()
    faults = partial(missing_density, field, space.canonical_vertices)
    return Problem(space, field, scene, objective, settings, ranks, from_scratch, faults)


def _settings(space: BoxSpace, learned: Learned, losses: LossConfig) -> dict[str, JsonValue]:
    return {
        "shape": space.shape.model_dump(mode="json"),
        "learned": asdict(learned),
        "losses": losses.model_dump(mode="json"),
    }


def _opened(
    folder: Path, clip: Clip, learned: Learned, seed: int, ranks: Ranks = ALONE
) -> tuple[BoxSpace, NetworkField, BoxScene]:
    """What a stage before has left, and the scene at the training frames."""
    torch.manual_seed(seed)
    space = BoxSpace.load(folder)
    field = space.build()
    field.load_state_dict(load_file(folder / _WEIGHTS))
    field.to(ranks.device)
    field.appearance.requires_grad_(learned.appearance_codes)
    for parameter in field.motion_parameters():
        parameter.requires_grad_(field.moves)
    return space, field, space.at(field, torch.from_numpy(clip.times[~clip.held_out]))


def network_space(
    clip: Clip,
    meshes: MeshSequence,
    canonical_frame: int,
    moves: bool,
    follows: Follows,
    networks: NetworksConfig,
    box: BoxConfig,
) -> BoxSpace:
    """Boxes of all frames, and the canonical body's place."""
    posed = meshes.at(clip.frame_indices)
    canonical = meshes.at(np.array([canonical_frame], np.int32)).vertices[0]
    margin_m = max(box.margin_xy_m, box.margin_z_m)
    centre, radius = box_of(torch.from_numpy(canonical), margin_m)
    shape = NetworkShape(
        networks=networks,
        times=tuple(clip.times[~clip.held_out].tolist()),
        centre_m=centre,
        radius_m=radius,
        moves=moves,
        coarse_samples=box.coarse_samples,
        fine_samples=box.fine_samples,
    )
    boxes = frame_boxes(posed.vertices, clip.times, clip.camera, box, follows)
    return BoxSpace(shape, boxes, canonical)


def _train(
    problem: Problem,
    pixels: PixelSource,
    schedule: ScheduleConfig,
    seed: int,
    workspace: Path,
    progress: Progress,
    clock: TrainingClock | None,
) -> StageResult:
    run = TrainingRun(
        problem,
        pixels,
        schedule,
        seed,
        Seconds(),
        workspace,
        progress,
        None,
        None,
        clock or TrainingClock(),
    )
    run.run()
    save_file(problem.field.state_dict(), workspace / _WEIGHTS)
    done = run.progress
    events = [asdict(event) for event in done.events]
    result = StageResult(done.step, done.threads, done.tries, events, run.recent_losses)
    (workspace / _RESULT).write_text(json.dumps(asdict(result)))
    run.forget_checkpoint()
    return result


def require_density(field: NetworkField, vertices: NDArray[np.float32]) -> None:
    """A ReLU that has ended below zero everywhere has no gradient to come back.

    Raises TrainingDiverged where most of the canonical mesh's vertices (V, 3) have no density.
    """
    for fault in missing_density(field, vertices):
        raise TrainingDiverged(
            f"{fault} after pretraining. Lower schedule.rate_networks or "
            "networks.density_unit_per_m, raise mesh_views.on_body, or take another --seed."
        )


@torch.no_grad()
def missing_density(field: NetworkField, vertices: NDArray[np.float32]) -> tuple[str, ...]:
    """The networks that have no density on most of the canonical mesh's vertices (V, 3)."""
    found = []
    for name, network in (("coarse", field.coarse), ("fine", field.fine)):
        density, _ = field.density(network, torch.from_numpy(vertices).to(field.centre))
        empty = float((density == 0).float().mean())
        if empty > _MOST_EMPTY:
            share = f"{100 * empty:.0f} % of the canonical mesh"
            found.append(f"the {name} network has no density on {share}")
    return tuple(found)


def _untrained(field: NetworkField, workspace: Path) -> StageResult:
    save_file(field.state_dict(), workspace / _WEIGHTS)
    return StageResult(0, 1, 1, [], {})
