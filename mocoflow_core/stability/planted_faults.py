"""What must not pass in silence: numbers that are none, frames that lie, bodies that freeze.

Each ends in a usable scene and an event or a warning, or stops with what, where and what to try.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import Tensor

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.motion_checks import (
    LARGEST_TURN_DEG,
    check_agreement,
    check_frozen,
    check_turns,
)
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import CaptureConfig
from mocoflow_core.capture.strange_frames import sound_clip
from mocoflow_core.geometry.rays import Rays
from mocoflow_core.stability.case import Case, Found, Value, require
from mocoflow_core.stability.optimisation import USABLE_DB
from mocoflow_core.stability.toy_scene import (
    RECORDING,
    SCHEDULE,
    Outcome,
    filmed,
    prepare,
    toy,
    train,
    undisturbed,
    with_frames,
    with_masks,
)
from mocoflow_core.training.batches import Batch, TrainingPixels
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.loop import TrainingRun

STEPS = SCHEDULE.joint_steps
GAPS = RECORDING.frames - 1  # from the first frame to the last
FLIP = 8  # the frame at which the estimate turns over
AT_STEPS = (0.0, 60.0, STEPS - 1.0)
THRESHOLD = CaptureConfig().difference_threshold

_MASK_TOO = ", with its mask"
Frames = NDArray[np.uint8]
Planting = Callable[[TrainingRun, Batch], Batch]


class PlantedPixels(TrainingPixels):
    """A run's own pixels, with a fault planted when the batch of one step is drawn."""

    def __init__(self, run: TrainingRun, at: int, plant: Planting) -> None:
        self.__dict__.update(run.pixels.__dict__)
        self.run = run
        self.at = at
        self.plant = plant

    def batch(self, rays: int, frames: int, generator: torch.Generator) -> Batch:
        drawn = super().batch(rays, frames, generator)
        return self.plant(self.run, drawn) if self.run.progress.step == self.at else drawn


def _planted(at: float, plant: Planting, named: str) -> Found:
    """Train with a fault planted at a step; the event names what was met."""

    def disturb(run: TrainingRun) -> None:
        run.pixels = PlantedPixels(run, int(at), plant)

    try:
        outcome = train(toy(), disturb=disturb)
    except TrainingDiverged as stopped:
        require(named in str(stopped) and "schedule" in str(stopped), f"says too little: {stopped}")
        return Found(0.0, remark=f"stopped: {stopped}")
    require(any(named in event for event in outcome.events), f"in silence: {outcome.events}")
    return _lost(outcome, outcome.events)


def _lost(outcome: Outcome, noticed: list[str]) -> Found:
    lost = max(undisturbed().psnr - outcome.psnr, 0.0)
    words = f"{outcome.psnr:.1f} dB. {'; '.join(noticed[:2])}"
    return Found(lost, (*outcome.weights, outcome.psnr), words)


def _in_frame(run: TrainingRun, batch: Batch) -> Batch:
    rgb = batch.rgb.clone()
    rgb[0, 0] = torch.nan
    return replace(batch, rgb=rgb)


def _in_ray(run: TrainingRun, batch: Batch) -> Batch:
    directions = batch.rays.directions.clone()
    directions[0, 0] = torch.nan
    return replace(batch, rays=Rays(batch.rays.origins, directions))


def _in_weight(run: TrainingRun, batch: Batch) -> Batch:
    with torch.no_grad():
        run.field.canonical.tables[0][0, 0] = torch.nan
    return batch


def _in_gradient(run: TrainingRun, batch: Batch) -> Batch:
    """One entry of one gradient, once."""

    def plant(gradient: Tensor) -> Tensor:
        handle.remove()
        spoilt = gradient.clone()
        spoilt[0, 0] = torch.nan
        return spoilt

    handle = run.field.canonical.tables[0].register_hook(plant)
    return batch


def _in_optimiser(run: TrainingRun, batch: Batch) -> Batch:
    """A moment that is no number spoils the weights with the next update."""
    run.optimiser.state[run.field.canonical.tables[0]]["exp_avg"][0, 0] = torch.nan
    return batch


def _every_time(run: TrainingRun, batch: Batch) -> Batch:
    """A frame that brings no numbers whenever it is drawn."""
    spoilt = run.pixels.frames.float()
    spoilt[5] = torch.nan
    run.pixels.frames = spoilt
    return batch


@dataclass(frozen=True, eq=False)
class Noticed:
    """A clip and meshes after the checks of a run, and what these said."""

    clip: Clip
    meshes: MeshSequence
    warnings: list[str]


def _checked(clip: Clip, meshes: MeshSequence) -> Noticed:
    """The checks of the stages extract_clip, ingest_meshes and repair_body, in this order."""
    sound, warnings = sound_clip(clip, THRESHOLD)
    warnings += check_frozen(meshes) + check_turns(meshes) + check_agreement(sound, meshes)
    return Noticed(sound, meshes, list(warnings))


def _noticed(clip: Clip, meshes: MeshSequence, named: str) -> Found:
    """Warned of by name, and still a usable scene."""
    found = _checked(clip, meshes)
    require(any(named in words for words in found.warnings), f"in silence: {found.warnings}")
    outcome = train(prepare(found.clip, found.meshes))
    return _lost(outcome, found.warnings + outcome.events)


def _frame(kind: str) -> Found:
    clip, meshes, _ = filmed()
    row = 5

    def spoil(frames: Frames) -> None:
        if kind == "black":
            frames[row] = 0
        elif kind == "white":
            frames[row] = 255
        elif kind == "pixels shuffled":
            flat = frames[row].reshape(-1, 3)
            frames[row] = np.random.default_rng(0).permutation(flat).reshape(frames[row].shape)
        else:
            frames[row] = frames[(row + 8) % len(frames)]

    spoilt = with_frames(clip, spoil)
    if kind.endswith(_MASK_TOO):

        def exchange(masks: NDArray[np.bool_]) -> None:
            masks[row] = masks[(row + 8) % len(masks)]

        spoilt = with_masks(spoilt, exchange)
    return _noticed(spoilt, meshes, f"frame {clip.frame_indices[row]}")


def _clean(kind: str) -> Found:
    """What is in order must not be warned of."""
    clip, meshes, _ = filmed()
    found = _checked(clip, meshes)
    require(not found.warnings, f"a sound {kind} is warned of: {found.warnings}")
    require(found.clip is clip, "a sound clip is changed")
    return Found(0.0)


def _masks_empty(count: float) -> Found:
    clip, meshes, _ = filmed()
    rows = slice(4, 4 + int(count))

    def empty(masks: NDArray[np.bool_]) -> None:
        masks[rows] = False

    return _noticed(with_masks(clip, empty), meshes, "empty mask")


def _meshes_frozen(count: float) -> Found:
    clip, meshes, _ = filmed()
    vertices = meshes.vertices.copy()
    vertices[3 : 3 + int(count)] = vertices[3]
    return _noticed(clip, replace(meshes, vertices=vertices), "does not move in")


def _flip(degrees: float) -> Found:
    """The estimate stands turned from one frame on; the person in the frames does not."""
    clip, meshes, _ = filmed()
    vertices = meshes.vertices.copy()
    middle = vertices[FLIP:].mean(axis=1, keepdims=True)
    rotation = Rotation.from_euler("z", degrees, degrees=True).as_matrix().astype(np.float32)
    vertices[FLIP:] = (vertices[FLIP:] - middle) @ rotation.T + middle
    return _noticed(clip, replace(meshes, vertices=vertices), "turns by up to")


def _turn(degrees: float) -> Found:
    """The person does turn so far between frames, and the estimate with it."""
    clip, meshes, _ = filmed(RECORDING.model_copy(update={"turn_deg": degrees * GAPS}))
    found = _checked(clip, meshes)
    far = degrees > LARGEST_TURN_DEG
    told = any("turns by up to" in words for words in found.warnings)
    require(told == far, f"told or not told wrongly: {found.warnings}")
    spun = prepare(found.clip, found.meshes)
    outcome = train(spun, seen=RECORDING.model_copy(update={"turn_deg": degrees * GAPS}))
    return _lost(outcome, found.warnings + outcome.events)


_LOST = "a posed body of one colour is 2 dB below the undisturbed scene, one gone astray 4 to 9 dB"


_HALF_WRONG = (
    f"{_LOST}; no training can put right what the estimate gets wrong in half of the frames: as "
    "much again"
)


def _planting(
    name: str, stiff: str, plant: Planting, named: str, at_steps: tuple[float, ...] = AT_STEPS
) -> Case[float]:
    return Case(
        name,
        stiff,
        "planted at step",
        at_steps,
        "the undisturbed scene, unseen views; an event names it",
        lambda at: _planted(at, plant, named),
        USABLE_DB,
        "dB",
        _LOST,
        quick=False,
    )


def _noticing(
    name: str,
    stiff: str,
    parameter: str,
    values: tuple[Value, ...],
    measure: Callable[[Value], Found],
    bound: float = USABLE_DB,
    reason: str = _LOST,
) -> Case[Value]:
    return Case(
        name,
        stiff,
        parameter,
        values,
        "the undisturbed scene, unseen views; a warning names it",
        measure,
        bound,
        "dB",
        reason,
        quick=False,
    )


CASES = (
    _planting("nan_in_a_frame", "a colour that is no number", _in_frame, "frame "),
    _planting("nan_in_a_ray", "a sample that is nowhere", _in_ray, "rays"),
    _planting("nan_in_a_weight", "a weight that is no number", _in_weight, "weight canonical"),
    _planting("nan_in_a_gradient", "a gradient that is no number", _in_gradient, "gradient of"),
    _planting(
        "nan_in_the_optimiser",
        "a moment that spoils the weights one update later, after the last look at them",
        _in_optimiser,
        "canonical.tables.0",
        AT_STEPS[1:],
    ),
    _planting(
        "nan_in_every_draw_of_a_frame",
        "refusing steps does not remove the cause",
        _every_time,
        "frame 5",
        (0.0, 60.0),
    ),
    _noticing(
        "strange_frame",
        "one frame that is not what the camera saw",
        "frame",
        (
            "black",
            "white",
            "pixels shuffled",
            "of another moment",
            "of another moment, with its mask",
        ),
        _frame,
    ),
    _noticing(
        "empty_masks",
        "masks that say nobody is there while the frames show somebody",
        "frames",
        (1.0, 5.0),
        _masks_empty,
    ),
    _noticing(
        "frozen_meshes",
        "a tracker that repeats its last answer",
        "frames",
        (3.0, 10.0),
        _meshes_frozen,
        2 * USABLE_DB,
        _HALF_WRONG,
    ),
    _noticing(
        "flipped_estimate",
        "an estimator that takes the back for the front from one frame on",
        "degrees",
        (150.0, 180.0),
        _flip,
        2 * USABLE_DB,
        _HALF_WRONG,
    ),
    _noticing(
        "turn_between_frames",
        "a turn by which the shorter way round may be the wrong one",
        "degrees",
        (60.0, 150.0, 180.0),
        _turn,
    ),
    Case(
        "sound_scene",
        "warnings where nothing is wrong are read by nobody",
        "scene",
        ("toy",),
        "no warning, the clip untouched",
        _clean,
        0.0,
        "",
        "a sound scene is taken as it is",
        quick=False,
    ),
)
