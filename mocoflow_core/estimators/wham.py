"""WHAM's ``wham_output.pkl`` and what its API returns: vertices in the camera's axes, placed.

A joblib ``defaultdict`` whose ids are ``numpy.int64``. The camera it assumes is as long as the
picture's diagonal unless it was given a calibration; the file does not say.
Layout: yohanshin/WHAM, demo.py and wham_api.py.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.estimators import bodies
from mocoflow_core.estimators.bodies import Bodies
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, people_of
from mocoflow_core.estimators.placement import ToolCamera, placed
from mocoflow_core.estimators.tracks import Track, choose_track, frames_of, row_arrays

TOOL = "WHAM"
# Names in the file and those of the API.
VERTICES = ("verts", "verts_cam")
FRAMES = ("frame_ids", "frame_id")


def recognises(stored: EstimateFile) -> bool:
    """Records placed in the camera's and the world's axes."""
    people = people_of(stored.content)
    return bool(people) and all(
        any(name in one for name in FRAMES)
        and ({"pose", "trans"} <= set(one) or "verts_cam" in one or "trans_world" in one)
        for one in people.values()
    )


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person, in the camera's axes for its intrinsics. Raises InputError without faces."""
    tracks = [_track(person, record) for person, record in people_of(stored.content).items()]
    track, chosen = choose_track(tracks, context.chosen.person)
    found = _bodies(track, context)
    made_for = ToolCamera.of_diagonal(context.camera, context.chosen.focal_px)
    vertices, refocus = placed(TOOL, found.vertices, made_for, context.camera)
    return BodyEstimate(
        source=TOOL,
        frame_indices=track.frame_indices,
        numbering="position",
        vertices=vertices,
        faces=found.faces,
        coordinates="camera",
        located=False,
        remarks=(*chosen, *found.remarks, *refocus),
    )


def _track(person: int, record: Mapping[str, object]) -> Track:
    name = next((name for name in FRAMES if name in record), FRAMES[0])
    frames = frames_of(record, name)
    return Track(person, frames, row_arrays(record, len(frames), name))


def _bodies(track: Track, context: EstimateContext) -> Bodies:
    pose = _pose(track)
    betas = track.rows("betas") if "betas" in track.arrays else None
    name = next((name for name in VERTICES if name in track.arrays), None)
    if name is None and pose is not None and betas is not None:
        return bodies.modelled(TOOL, pose, betas, context, track.floats("trans", 3))
    return bodies.stored(TOOL, track.bodies(name or VERTICES[0]), pose, betas, context)


def _pose(track: Track) -> NDArray[np.float64] | None:
    if "pose" in track.arrays:
        return track.rotations("pose", 24)
    if {"poses_root_cam", "poses_body"} <= set(track.arrays):
        root, body = track.rotations("poses_root_cam", 1), track.rotations("poses_body", 23)
        return np.concatenate([root, body], axis=1)
    return None
