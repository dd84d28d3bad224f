"""GVHMR's ``hmr4d_results.pt``: SMPL-X pose and shape in the camera's axes, placed.

One person; entry i belongs to frame i of the video, whatever rate its copy claims.
Layout: zju3dv/GVHMR, tools/demo/demo.py.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.bodies import shapes_of
from mocoflow_core.estimators.context import JOINTS, EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile
from mocoflow_core.estimators.placement import ToolCamera, placed
from mocoflow_core.estimators.tracks import Track, choose_track, row_arrays

TOOL = "GVHMR"
BODY_JOINTS = 21
IN_CAMERA = "smpl_params_incam"


def recognises(stored: EstimateFile) -> bool:
    """A dictionary with parameters in the camera's axes."""
    return isinstance(stored.content, Mapping) and IN_CAMERA in stored.content


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """The person, in the camera's axes for its intrinsics.

    Raises InputError without the SMPL-X model.
    """
    track, _ = choose_track([_track(stored)], context.chosen.person)
    model = context.require_model(TOOL, "SMPL-X")
    shape, remarks = shapes_of(track.rows("betas"), context)
    bodies = posed_vertices(
        model, _pose(track), shape, track.floats("transl", 3), progress=context.progress
    )
    vertices, refocus = placed(
        TOOL, bodies.astype(np.float32), _camera(track, context), context.camera
    )
    return BodyEstimate(
        source=TOOL,
        frame_indices=track.frame_indices,
        numbering="position",
        vertices=vertices,
        faces=model.faces.astype(np.int32),
        coordinates="camera",
        located=False,
        remarks=(*remarks, "hands are flat and the face rests: GVHMR sees neither", *refocus),
    )


def _track(stored: EstimateFile) -> Track:
    content = stored.content
    record = content.get(IN_CAMERA) if isinstance(content, Mapping) else None
    if not isinstance(content, Mapping) or not isinstance(record, Mapping):
        raise InputError(
            f"hmr4d_results.pt with {IN_CAMERA}",
            "something else",
            "Give outputs/demo/<video>/hmr4d_results.pt.",
        )
    count = len(np.atleast_1d(np.asarray(record.get("transl", ()))))
    whole = {**record, "K_fullimg": content.get("K_fullimg")}
    frames = np.arange(count, dtype=np.int32)
    return Track(None, frames, row_arrays(whole, count, ""))


def _pose(track: Track) -> NDArray[np.float64]:
    """Axis-angle (T, 55, 3): root and body; jaw, eyes and hands at rest."""
    pose = np.zeros((len(track), JOINTS["SMPL-X"], 3))
    pose[:, :1] = track.floats("global_orient", 1, 3)
    pose[:, 1 : 1 + BODY_JOINTS] = track.floats("body_pose", BODY_JOINTS, 3)
    return pose


def _camera(track: Track, context: EstimateContext) -> ToolCamera:
    """Its intrinsics, in pixels of the scene's pictures; those of the diagonal without any."""
    if "K_fullimg" not in track.arrays:
        return ToolCamera.of_diagonal(context.camera, context.chosen.focal_px)
    K = track.floats("K_fullimg", 3, 3)
    scale = context.camera.width / (2 * K[:, 0, 2])
    focal_px = context.chosen.focal_px or K[:, 0, 0]
    return ToolCamera(scale * focal_px, scale[:, None] * K[:, :2, 2])
