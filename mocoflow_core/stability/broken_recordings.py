"""Recordings and estimates that are not what they seem: frames, masks and bodies that lie.

Each is warned of and still ends in a usable scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

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
from mocoflow_core.stability.case import Case, Found, Value, require
from mocoflow_core.stability.toy_scene import (
    RECORDING,
    filmed,
    prepare,
    train,
    with_frames,
    with_masks,
)
from mocoflow_core.stability.usable_scene import USABLE_DB, WHY_USABLE, lost

GAPS = RECORDING.frames - 1  # from the first frame to the last
FLIP = 8  # the frame at which the estimate turns over
THRESHOLD = CaptureConfig().difference_threshold

_MASK_TOO = ", with its mask"
Frames = NDArray[np.uint8]


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
    return lost(outcome, found.warnings + outcome.events)


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
    return lost(outcome, found.warnings + outcome.events)


_HALF_WRONG = (
    f"{WHY_USABLE}; no training can put right what the estimate gets wrong in half of the frames: "
    "as much again"
)


def _noticing(
    name: str,
    stiff: str,
    parameter: str,
    values: tuple[Value, ...],
    measure: Callable[[Value], Found],
    bound: float = USABLE_DB,
    reason: str = WHY_USABLE,
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
