"""ROMP's and BEV's results: a file per frame, or ``video_results.npz`` with all of them.

People come in any order unless they were tracked; frames without any have no file. ``cam`` is
``s, tx, ty`` in ROMP and ``s, ty, tx`` in BEV, on the picture padded to a square.
Layout: Arthur151/ROMP, simple_romp/romp and simple_romp/bev.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.blend_skinning import posed_joints
from mocoflow_core.errors import InputError
from mocoflow_core.estimators import bodies
from mocoflow_core.estimators.bodies import Bodies
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, frame_numbers, read_stored
from mocoflow_core.estimators.placement import (
    ToolCamera,
    middle,
    middles,
    refocused,
    weak_translations,
    where_known,
)
from mocoflow_core.estimators.track_association import follow_people
from mocoflow_core.estimators.tracks import Track, choose_track

Array = NDArray[np.float64]
People = Mapping[str, NDArray[np.generic]]

PARTS = ("cam", "cam_trans", "smpl_thetas", "smpl_betas", "verts")
# Field of view of the padded square that cam_trans belongs to.
HALF_VIEW = np.tan(np.radians(30))
BEV_BETAS = 11
CHILD = 0.1  # of the child's share, above which a body without it is another one


def recognises(stored: EstimateFile) -> bool:
    """Results of a frame, of a video, or a folder with a file per frame."""
    if stored.is_folder:
        files = stored.files(".npz")
        return bool(files) and _is_result(read_stored(files[0]))
    return _is_result(stored.content)


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person, root-centred, with its place as the camera says it. Raises InputError without
    faces, or without the SMPL model where there are no vertices."""
    track, chosen = choose_track(_tracks(_frames(stored)), context.chosen.person)
    is_bev = track.arrays["smpl_betas"].shape[-1] == BEV_BETAS
    tool = "BEV" if is_bev else "ROMP"
    found = _bodies(tool, track, context)
    anchors = middles(found.vertices)
    place = _bev_translations if is_bev else _romp_translations
    return BodyEstimate(
        source=tool,
        frame_indices=track.frame_indices,
        numbering="source",
        vertices=found.vertices,
        faces=found.faces,
        coordinates="camera-root-centred",
        located=False,
        first_translations=where_known(place(track, anchors, context)),
        remarks=(*chosen, *found.remarks),
    )


def _is_result(content: object) -> bool:
    results = content.get("results") if isinstance(content, Mapping) else None
    if not isinstance(results, Mapping):
        return False
    first = next(iter(results.values()), None)
    return "cam" in results or (isinstance(first, Mapping) and "cam" in first)


def _frames(stored: EstimateFile) -> dict[int, People]:
    """People by frame number: what files and pictures are named by."""
    if stored.is_folder:
        contents = {file.name: read_stored(file) for file in stored.files(".npz")}
    else:
        contents = {stored.path.name: stored.content}
    named: dict[str, People] = {}
    for name, content in contents.items():
        results = content.get("results") if isinstance(content, Mapping) else None
        if not isinstance(results, Mapping):
            raise InputError(
                "files of ROMP or BEV with results", f"none in {name}", "Remove other files."
            )
        # video_results.npz repeats its neighbours.
        named |= {name: results} if "cam" in results else results
    named = {name: people for name, people in named.items() if len(people)}
    if stored.is_folder:
        named = {name.rpartition(".")[0]: people for name, people in named.items()}
    return dict(zip(frame_numbers(named), named.values(), strict=True))


def _tracks(frames: Mapping[int, People]) -> list[Track]:
    whole = {frame: _rows(people) for frame, people in frames.items()}
    tracked = all("track_ids" in people for people in frames.values())
    if tracked:
        who = {frame: np.ravel(people["track_ids"]).astype(int) for frame, people in frames.items()}
    else:
        # In units of the padded square's side, whose normalised width is 2.
        who = follow_people({frame: rows["cam"] / 2 for frame, rows in whole.items()})
    rows: dict[int, list[tuple[int, dict[str, Array]]]] = defaultdict(list)
    for frame, people in whole.items():
        for row, person in enumerate(who[frame]):
            rows[int(person)].append((frame, {name: part[row] for name, part in people.items()}))
    note = () if tracked else ("people are followed by their place in the picture",)
    several = any(len(people["cam"]) > 1 for people in whole.values())
    return [_track(person, found, note if several else ()) for person, found in rows.items()]


def _rows(people: People) -> dict[str, Array]:
    """The parts with a row for each person; a single person may come without that axis."""
    cam = np.atleast_2d(np.asarray(people["cam"], np.float64))
    known = {name: np.asarray(people[name], np.float64) for name in PARTS if name in people}
    if "smpl_thetas" not in known and {"global_orient", "body_pose"} <= set(people):
        parts = [np.asarray(people[name]) for name in ("global_orient", "body_pose")]
        known["smpl_thetas"] = np.concatenate([part.reshape(len(cam), -1) for part in parts], 1)
    return {name: part.reshape(len(cam), -1) for name, part in known.items()}


def _track(
    person: int, rows: list[tuple[int, dict[str, Array]]], remarks: tuple[str, ...]
) -> Track:
    names = set.intersection(*(set(body) for _, body in rows))
    if "smpl_betas" not in names:
        raise InputError("results of ROMP or BEV with smpl_betas", "none", "Run the tool again.")
    frames = np.array([frame for frame, _ in rows], np.int32)
    arrays = {name: np.stack([body[name] for _, body in rows]) for name in names}
    return Track(person, frames, arrays, remarks=remarks)


def _bodies(tool: str, track: Track, context: EstimateContext) -> Bodies:
    betas = track.rows("smpl_betas")
    child = float(np.abs(betas[:, 10:]).max(initial=0.0))
    pose = track.rotations("smpl_thetas", 24) if "smpl_thetas" in track.arrays else None
    if "verts" in track.arrays:
        # A child's body is no SMPL body: it stays as it is.
        own_pose = None if child > CHILD else pose
        return bodies.stored(tool, track.bodies("verts"), own_pose, betas[:, :10], context)
    found = bodies.modelled(tool, track.rotations("smpl_thetas", 24), betas[:, :10], context)
    if betas.shape[-1] != BEV_BETAS:
        return found
    remarks = found.remarks
    if child > CHILD:
        remarks = (*remarks, f"the child's share of the shape, {child:.2f}, is left out")
    # BEV measures from the middle between both hips.
    model = context.require_model(tool, "SMPL")
    joints = posed_joints(model, track.rotations("smpl_thetas", 24), np.median(betas, 0)[:10])
    hips = joints[:, 1:3].mean(axis=1, keepdims=True)
    return Bodies((found.vertices - hips).astype(np.float32), found.faces, remarks)


def _romp_translations(track: Track, anchors: Array, context: EstimateContext) -> Array:
    """Exact from the weak perspective camera that ROMP projects with: ``u = s X + tx``."""
    half_px = max(context.camera.width, context.camera.height) / 2
    cam = track.floats("cam", 3)
    origin_px = middle(context.camera) + half_px * cam[:, 1:]
    return weak_translations(half_px * cam[:, 0], origin_px, anchors, context.camera)


def _bev_translations(track: Track, anchors: Array, context: EstimateContext) -> Array:
    """From BEV's perspective camera; where it is missing, from ``s, ty, tx``."""
    half_px = max(context.camera.width, context.camera.height) / 2
    made_for = ToolCamera(half_px / HALF_VIEW, middle(context.camera))
    if "cam_trans" in track.arrays:
        return refocused(track.floats("cam_trans", 3), anchors, made_for, context.camera)
    cam = track.floats("cam", 3)
    depth = 1 / (cam[:, 0] * HALF_VIEW + 1e-3)
    lateral = cam[:, :0:-1] * (depth * HALF_VIEW)[:, None]
    return refocused(np.column_stack([lateral, depth]), anchors, made_for, context.camera)
