"""TRAM's ``hps_track_<k>.npy`` or its results folder: SMPL matrices in the camera's axes, placed.

The arrays are torch tensors inside object files. Focal length and centre lie in ``camera.npy``,
which the folder has beside ``hps``. Layout: yufu-wang/tram, scripts/*.py, lib/models/hmr_vimo.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.bodies import modelled
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, frame_numbers, read_stored
from mocoflow_core.estimators.placement import ToolCamera, placed
from mocoflow_core.estimators.tracks import Arrays, Track, choose_track, frames_of, row_arrays

TOOL = "TRAM"
PARTS = {"pred_rotmat", "pred_shape", "pred_trans", "frame"}
CAMERA = ("img_focal", "img_center", "pred_cam_R")
# Pictures whose middle is nearer to the principal point were not resized.
SAME_WIDTH = 0.05
# Above this, TRAM saw the camera move.
STILL_DEG = 1.0


def recognises(stored: EstimateFile) -> bool:
    """A dictionary of a track, or a folder with tracks below ``hps``."""
    if stored.is_folder:
        return bool(_track_files(stored))
    return isinstance(stored.content, Mapping) and set(stored.content) >= PARTS


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person, in the camera's axes for its intrinsics. Raises InputError without the model."""
    track, chosen = choose_track(_tracks(stored), context.chosen.person)
    bodies = modelled(
        TOOL,
        track.floats("pred_rotmat", 24, 3, 3),
        track.rows("pred_shape"),
        context,
        track.floats("pred_trans", 3),
    )
    made_for, assumed = _camera(track, context)
    vertices, refocus = placed(TOOL, bodies.vertices, made_for, context.camera)
    return BodyEstimate(
        source=TOOL,
        frame_indices=track.frame_indices,
        numbering="position",
        vertices=vertices,
        faces=bodies.faces,
        coordinates="camera",
        located=False,
        remarks=(*chosen, *bodies.remarks, *assumed, *refocus, *_motion(track)),
    )


def _track_files(stored: EstimateFile) -> list[Path]:
    inside = [*stored.files(".npy"), *stored.files(".npy", below="hps")]
    return [file for file in inside if file.name.startswith("hps_track_")]


def _tracks(stored: EstimateFile) -> list[Track]:
    if not stored.is_folder:
        return [_track(None, stored.content, {})]
    camera = stored.path / "camera.npy"
    constants = _constants(read_stored(camera)) if camera in stored.files(".npy") else {}
    files = _track_files(stored)
    numbers = frame_numbers(file.name for file in files)
    return [_track(k, read_stored(file), constants) for k, file in zip(numbers, files, strict=True)]


def _track(person: int | None, content: object, constants: Arrays) -> Track:
    if not isinstance(content, Mapping) or not set(content) >= PARTS:
        raise InputError(
            f"tracks of TRAM with {', '.join(sorted(PARTS))}",
            ", ".join(map(str, content)) if isinstance(content, Mapping) else "no dictionary",
            "Give results/<video>, or one of its hps/hps_track_<k>.npy.",
        )
    frames = frames_of(content, "frame")
    arrays = row_arrays(content, len(frames), "frame")
    return Track(person, frames, arrays, {**constants, **_constants(content)})


def _constants(content: object) -> Arrays:
    """What is known of the camera, of a folder's camera.npy or of a track that repeats it."""
    if not isinstance(content, Mapping):
        return {}
    return {name: np.asarray(content[name]) for name in CAMERA if name in content}


def _camera(track: Track, context: EstimateContext) -> tuple[ToolCamera, tuple[str, ...]]:
    """TRAM's camera in pixels of the scene's pictures."""
    camera, focal_px = context.camera, context.chosen.focal_px
    stored = track.constants.get("img_focal")
    if stored is not None:
        focal_px = focal_px or float(np.ravel(stored)[0])
    if focal_px is None:
        own = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
        note = (
            "the focal length that TRAM worked with is in camera.npy: without the results folder "
            "it is taken for the camera's own"
        )
        return ToolCamera(own, camera.K[:2, 2]), (note,)
    stored_centre = track.constants.get("img_center")
    if stored_centre is None:
        return ToolCamera.of_diagonal(camera, focal_px), ()
    centre = np.ravel(stored_centre)[:2].astype(np.float64)
    scale = camera.width / (2 * centre[0])
    scale = 1.0 if abs(scale - 1) < SAME_WIDTH else float(scale)
    return ToolCamera(scale * focal_px, scale * centre), ()


def _motion(track: Track) -> tuple[str, ...]:
    """A warning where TRAM believes that the camera moved: here it stands still."""
    if "pred_cam_R" not in track.constants:
        return ()
    turns: NDArray[np.float64] = np.asarray(track.constants["pred_cam_R"], np.float64)
    turns = turns.reshape(-1, 3, 3)
    cosines = (np.einsum("tij,ij->t", turns, turns[0]) - 1) / 2
    turned_deg = float(np.degrees(np.arccos(cosines.clip(-1, 1))).max())
    if turned_deg < STILL_DEG:
        return ()
    return (f"TRAM saw the camera turn by {turned_deg:.1f} degrees; it is taken to stand still",)
