"""Results of PHALP and 4D-Humans: SMPL rotation matrices, and a camera of very long focal length.

A joblib dictionary of frames; in each, parallel lists with an item per track. Tracks that were
not seen are carried on for a while: these ghosts have ``tracked_time`` above 0 and are left out.
Layout: brjathu/PHALP, phalp/trackers/PHALP.py.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.bodies import modelled
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, frame_numbers
from mocoflow_core.estimators.placement import ToolCamera, middles, refocused, where_known
from mocoflow_core.estimators.tracks import Track, choose_track

TOOL = "PHALP"
# Focal length in pixels of a network's picture, whose side stands for the longer image side.
FOCAL_PX, NETWORK_SIDE_PX = 5000.0, 256.0
PARTS = ("tid", "tracked_time", "smpl", "camera", "size")


def recognises(stored: EstimateFile) -> bool:
    """A dictionary of frames with parallel lists of tracks."""
    return any("smpl" in frame and "tid" in frame for frame in _frames(stored.content).values())


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person, root-centred, with its place as the long camera says it.

    Raises InputError without the SMPL model, and for a list of boxes without bodies.
    """
    tracks, ghosts = _tracks(_frames(stored.content))
    track, chosen = choose_track(tracks, context.chosen.person)
    pose = np.concatenate(
        [track.floats("global_orient", 1, 3, 3), track.floats("body_pose", 23, 3, 3)], axis=1
    )
    bodies = modelled(TOOL, pose, track.rows("betas"), context)
    translations = refocused(
        track.floats("camera", 3),
        middles(bodies.vertices),
        _camera(track.floats("size", 2), context),
        context.camera,
    )
    left_out = (f"{ghosts} entries that PHALP only predicted are left out",) if ghosts else ()
    return BodyEstimate(
        source=TOOL,
        frame_indices=track.frame_indices,
        numbering="position",
        vertices=bodies.vertices,
        faces=bodies.faces,
        coordinates="camera-root-centred",
        located=False,
        first_translations=where_known(translations),
        remarks=(*chosen, *left_out, *bodies.remarks),
    )


def _frames(content: object) -> dict[str, Mapping[str, Any]]:
    """Records by the name of their frame; empty for what is no such dictionary."""
    if not isinstance(content, Mapping):
        return {}
    frames = {name: frame for name, frame in content.items() if isinstance(name, str)}
    alike = len(frames) == len(content) and all(isinstance(f, Mapping) for f in frames.values())
    return frames if alike else {}


def _tracks(frames: dict[str, Mapping[str, Any]]) -> tuple[list[Track], int]:
    """The tracks, and how many ghosts there were."""
    numbers = _positions(frames)
    rows: dict[int, list[tuple[int, dict[str, NDArray[np.float64]]]]] = defaultdict(list)
    ghosts = 0
    for name, frame in frames.items():
        people, waited = frame.get("tid", ()), frame.get("tracked_time", ())
        parts = {part: frame.get(part, ()) for part in ("smpl", "camera", "size")}
        for part, items in {"tracked_time": waited, **parts}.items():
            if len(items) != len(people):
                raise InputError(
                    f"frames of PHALP with as many {part} as tid",
                    f"{len(items)} for {len(people)} in {name}",
                    "Give results/demo_<video>.pkl as it was written, with bodies in it.",
                )
        for item, person in enumerate(people):
            if waited[item] > 0:
                ghosts += 1
                continue
            body = {part: np.asarray(value) for part, value in parts["smpl"][item].items()}
            body |= {part: np.asarray(parts[part][item]) for part in ("camera", "size")}
            rows[int(person)].append((numbers[name], body))
    return [_track(person, found) for person, found in rows.items()], ghosts


def _track(person: int, rows: list[tuple[int, dict[str, NDArray[np.float64]]]]) -> Track:
    frames = np.array([number for number, _ in rows], np.int32)
    names = set.intersection(*(set(body) for _, body in rows))
    return Track(person, frames, {name: np.stack([b[name] for _, b in rows]) for name in names})


def _positions(frames: dict[str, Mapping[str, Any]]) -> dict[str, int]:
    """Position of each frame in the video: by its ``time``, else by the number in its name.

    Every frame has an entry, with people or not, and names may begin at 1: the first is 0.
    """
    if all("time" in frame for frame in frames.values()):
        return {name: int(frame["time"]) for name, frame in frames.items()}
    numbers = frame_numbers(frames)
    return dict(zip(frames, (number - min(numbers) for number in numbers), strict=True))


def _camera(sizes: NDArray[np.float64], context: EstimateContext) -> ToolCamera:
    """The tool's camera in pixels of the scene's pictures; sizes (n, 2) are height, width."""
    scale = context.camera.width / sizes[:, 1]
    focal_px = scale * (context.chosen.focal_px or FOCAL_PX / NETWORK_SIDE_PX * sizes.max(axis=1))
    return ToolCamera(focal_px, scale[:, None] * sizes[:, ::-1] / 2)
