"""What one optimisation learns and from what, for the loop that is the same for all."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.posed_scene import PosedScene, Space
from mocoflow_core.rendering.shell_space import ShellSpace
from mocoflow_core.training.fit_motion import MotionStart
from mocoflow_core.training.objective import Objective, ShellObjective


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


def shell_problem(
    density: CanonicalDensity,
    motion: MotionStart,
    shape: SceneShape,
    learned: Learned,
    losses: LossConfig,
    seed: int,
) -> Problem:
    """The fast representation: the body's motion with a residual, a grid on top of the mesh."""
    torch.manual_seed(seed)
    space = ShellSpace(shape, density, motion.controls)
    field = space.build()
    _freeze_what_is_not_needed(field, learned)
    scene = space.at_training_frames(field, motion.body)
    weights = losses if learned.consensus else losses.model_copy(update={"consensus_weight": 0.0})
    return Problem(space, field, scene, ShellObjective(scene, weights, learned.motion_residual))


def _freeze_what_is_not_needed(field: SceneField, learned: Learned) -> None:
    for parameter in field.motion_parameters():
        parameter.requires_grad_(learned.motion_residual)
    field.appearance.requires_grad_(learned.appearance_codes)
