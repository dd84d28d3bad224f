"""What one optimisation learns and from what, for the loop that is the same for all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import torch
from pydantic import JsonValue

from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.posed_scene import PosedScene, Space
from mocoflow_core.rendering.shell_space import ShellSpace
from mocoflow_core.training.fit_motion import MotionStart
from mocoflow_core.training.objective import Objective, ShellObjective
from mocoflow_core.training.ranks import ALONE, Ranks


@dataclass(frozen=True)
class Learned:
    """Which parts of the field this scene needs; the plan decides."""

    motion_residual: bool = True
    consensus: bool = True
    appearance_codes: bool = True


@dataclass(frozen=True, eq=False)
class Problem:
    """A field to be trained, the scene that it makes at the training frames, its losses."""

    space: Space
    field: SceneField
    scene: PosedScene
    objective: Objective
    settings: dict[str, JsonValue]  # that make it this problem and no other
    ranks: Ranks = ALONE  # that share its rays
    from_scratch: bool = False  # nothing was learned before that could be lost
    faults: Callable[[], tuple[str, ...]] = tuple  # sentences about the present weights


def shell_problem(
    density: CanonicalDensity,
    motion: MotionStart,
    shape: SceneShape,
    learned: Learned,
    losses: LossConfig,
    seed: int,
    ranks: Ranks = ALONE,
) -> Problem:
    """The fast representation: the body's motion with a residual, a grid on top of the mesh."""
    torch.manual_seed(seed)
    space = ShellSpace(shape, density, motion.controls)
    field = space.build().to(ranks.device)
    _freeze_what_is_not_needed(field, learned)
    scene = space.at_training_frames(field, motion.body)
    weights = losses if learned.consensus else losses.model_copy(update={"consensus_weight": 0.0})
    objective = ShellObjective(scene, weights, learned.motion_residual, ranks)
    settings: dict[str, JsonValue] = {
        "shape": shape.model_dump(mode="json"),
        "learned": asdict(learned),
        "losses": losses.model_dump(mode="json"),
    }
    return Problem(space, field, scene, objective, settings, ranks)


def _freeze_what_is_not_needed(field: SceneField, learned: Learned) -> None:
    for parameter in field.motion_parameters():
        parameter.requires_grad_(learned.motion_residual)
    field.appearance.requires_grad_(learned.appearance_codes)
