"""VIBE's ``vibe_output.pkl``: root-centred vertices and a weak perspective camera per frame.

A joblib dictionary of people; arrays are indexed by position and joined through ``frame_ids``.
Layout: mkocabas/VIBE, demo.py and lib/utils/demo_utils.py.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.estimators.bodies import Bodies, modelled
from mocoflow_core.estimators.bodies import stored as own_bodies
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, people_of
from mocoflow_core.estimators.placement import (
    box_placement,
    middle,
    middles,
    weak_translations,
    where_known,
)
from mocoflow_core.estimators.tracks import Track, choose_track, frames_of, row_arrays
from mocoflow_core.geometry.camera import Camera

Array = NDArray[np.float64]

# The network sees a square 1.1 times the stored box, which orig_cam does not know of.
CROP_FACTOR = 1.1
# Widths of pictures that differ by less are the same, rounded.
SAME_WIDTH = 0.005


def recognises(stored: EstimateFile) -> bool:
    """Records with a weak perspective camera, pose as axis-angle."""
    people = people_of(stored.content)
    return bool(people) and all(
        is_cropped(one) and not has_matrices(one) for one in people.values()
    )


def is_cropped(record: Mapping[str, object]) -> bool:
    """Whether a record is of the family of VIBE: a crop's camera, frames by ``frame_ids``."""
    return "frame_ids" in record and ("orig_cam" in record or {"pred_cam", "bboxes"} <= set(record))


def has_matrices(record: Mapping[str, object]) -> bool:
    """Whether pose is stored as rotation matrices, or keypoints as PARE names them."""
    return "smpl_joints2d" in record or np.ndim(record.get("pose")) >= 3  # type: ignore[arg-type]


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person of ``vibe_output.pkl``. Raises InputError without faces."""
    return read_cropped("VIBE", CROP_FACTOR, stored, context)


def read_cropped(
    tool: str, factor: float, stored: EstimateFile, context: EstimateContext
) -> BodyEstimate:
    """One person of a file in VIBE's layout, whose network saw ``factor`` times its boxes."""
    tracks = [_track(person, record) for person, record in people_of(stored.content).items()]
    track, chosen = choose_track(tracks, context.chosen.person)
    bodies = _bodies(tool, track, context)
    translations, placed = _translations(
        track, middles(bodies.vertices), context.chosen.crop_factor or factor, context.camera
    )
    return BodyEstimate(
        source=tool,
        frame_indices=track.frame_indices,
        numbering="position",
        vertices=bodies.vertices,
        faces=bodies.faces,
        coordinates="camera-root-centred",
        located=False,
        first_translations=None if translations is None else where_known(translations),
        remarks=(*chosen, *bodies.remarks, *placed, *_followed_poses(tool, track)),
    )


def _followed_poses(tool: str, track: Track) -> tuple[str, ...]:
    """A remark where people were followed by 2-D poses: their boxes come from another routine."""
    if "joints2d" not in track.arrays:
        return ()
    return (
        f"{tool} followed 2-D poses, whose boxes another routine makes: compare the bodies with "
        "the silhouettes, and set meshes.crop_factor where they are too large or too small",
    )


def _track(person: int, record: Mapping[str, object]) -> Track:
    frames = frames_of(record, "frame_ids")
    return Track(person, frames, row_arrays(record, len(frames), "frame_ids"))


def _bodies(tool: str, track: Track, context: EstimateContext) -> Bodies:
    pose = betas = None
    if {"pose", "betas"} <= set(track.arrays):
        pose, betas = track.rotations("pose", 24), track.rows("betas")
        if "verts" not in track.arrays:
            return modelled(tool, pose, betas, context)
    return own_bodies(tool, track.bodies("verts"), pose, betas, context)


def _translations(
    track: Track, anchors: Array, factor: float, camera: Camera
) -> tuple[Array | None, tuple[str, ...]]:
    """Where the bodies stand, exact from ``pred_cam`` and ``bboxes``, about from ``orig_cam``."""
    if {"pred_cam", "bboxes"} <= set(track.arrays):
        cam = track.floats("pred_cam", 3)
        boxes = track.rows("bboxes")[:, :3]
        shrunk, remarks = _shrunk(track, cam, boxes, camera)
        scale_px, origin_px = box_placement(
            cam, shrunk * boxes[:, :2], factor * shrunk * boxes[:, 2]
        )
        return weak_translations(scale_px, origin_px, anchors, camera), remarks
    if "orig_cam" not in track.arrays:
        return None, ()
    orig = track.floats("orig_cam", 4)
    half = middle(camera)
    origin_px = half * (1 + orig[:, :2] * orig[:, 2:])
    scale_px = factor * half[0] * orig[:, 0]
    note = "without pred_cam and bboxes the crop factor corrects the depth alone"
    return weak_translations(scale_px, origin_px, anchors, camera), (note,) if factor != 1 else ()


def _shrunk(
    track: Track, cam: Array, boxes: Array, camera: Camera
) -> tuple[float, tuple[str, ...]]:
    """Pixels of the scene's pictures for one of those that the tool was given.

    ``orig_cam`` was made from box and camera with the pictures' width, which is thus known.
    """
    if "orig_cam" not in track.arrays:
        return 1.0, ()
    width = float(np.median(cam[:, 0] * boxes[:, 2] / track.floats("orig_cam", 4)[:, 0]))
    ratio = camera.width / width
    if not np.isfinite(ratio) or abs(ratio - 1) < SAME_WIDTH:
        return 1.0, ()
    return ratio, (
        f"the estimate was made from pictures {width:.0f} px wide; its boxes are scaled to "
        f"{camera.width} px",
    )
