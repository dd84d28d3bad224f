"""A synthetic person written exactly as People-Snapshot lies on disk, with a lens that bends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.rasterise import interpolate, rasterise
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.geometry.camera import Camera
from tests.capsule_person import room
from tests.lossless_video import write_lossless
from tests.python2_pickle import python2_pickle

DISTORTION = [-0.5, 0.15, 0.004, -0.003, 0.02]
FINER = 3  # Rays per pixel along each axis of what is then bent.
WIDER = 1.3  # A lens that draws in shows more than the pinhole of the same size.
JOINTS = {"left_shoulder": 16, "right_shoulder": 17, "left_elbow": 18}


@dataclass
class SnapshotRecording:
    """What the layout is written from; tests change a field to plant a fault."""

    camera: Camera  # corner origin, as everywhere in the project
    model: SmplModel
    pose: np.ndarray  # (N, 24, 3)
    translation: np.ndarray  # (N, 3)
    shape: np.ndarray  # (10,) of the consensus
    offsets: np.ndarray  # (V, 3)
    frames: np.ndarray  # (N, H, W, 3)
    masks: np.ndarray  # (N, H, W)
    fps: float = 24.0
    surplus: str = "none"  # one pose more than masks: at the "start" or "end"
    keypoints: bool = False

    @property
    def bodies(self):
        """(N, V, 3) what the frames show."""
        return posed_vertices(self.model, self.pose, self.shape, self.translation, self.offsets)


def turning(frames: int, side: int, model_file: Path) -> SnapshotRecording:
    """A person that turns and waves fast enough for a single frame to show in outlines."""
    model = read_smpl_model(model_file)
    rng = np.random.default_rng(7)
    steps = np.arange(frames)
    pose = np.zeros((frames, 24, 3))
    upright = Rotation.from_euler("x", np.pi)  # SMPL's y is up, the camera's down.
    pose[:, 0] = (upright * Rotation.from_euler("y", 0.2 * steps[:, None])).as_rotvec()
    pose[:, JOINTS["left_shoulder"], 2] = 0.5 * np.sin(0.7 * steps)
    pose[:, JOINTS["right_shoulder"], 2] = 0.5 * np.cos(0.5 * steps)
    pose[:, JOINTS["left_elbow"], 1] = 0.4 * np.sin(0.3 * steps)
    height = np.ptp(model.template[:, 1])
    translation = np.zeros((frames, 3))
    translation[:, 0] = 0.08 * np.sin(0.4 * steps)
    translation[:, 2] = 1.85 * height
    K = np.array([[1.6 * side, 0, 0.51 * side], [0, 1.62 * side, 0.49 * side], [0, 0, 1.0]])
    camera = Camera("camera", side, side, K, np.eye(3), np.zeros(3), np.array(DISTORTION))
    shape = rng.normal(0, 0.3, 10)
    offsets = 0.004 * height * rng.normal(0, 1, (len(model.template), 3))
    unplaced = posed_vertices(model, pose[:1], shape, np.zeros((1, 3)), offsets)
    translation -= 0.5 * (unplaced.max(axis=1) + unplaced.min(axis=1))
    bodies = posed_vertices(model, pose, shape, translation, offsets)
    shown = [_filmed(vertices, model, camera) for vertices in bodies]
    images, masks = (np.stack(part) for part in zip(*shown, strict=True))
    return SnapshotRecording(camera, model, pose, translation, shape, offsets, images, masks)


def write_snapshot(folder: Path, recording: SnapshotRecording) -> Path:
    """Write video, camera.pkl, masks, keypoints, poses and consensus; returns the folder."""
    folder.mkdir(parents=True)
    write_lossless(folder / f"{folder.name}.mp4", recording.frames, recording.fps)
    camera, count = recording.camera, len(recording.masks)
    values = {
        "camera_f": np.array([camera.K[0, 0], camera.K[1, 1]]),
        "camera_c": camera.K[:2, 2] - 0.5,  # OpenCV's: pixel centres at integers.
        "camera_k": camera.distortion,
        "camera_t": camera.t,
        "camera_rt": np.ravel(cv2.Rodrigues(camera.R)[0]),
        "width": camera.width,
        "height": camera.height,
    }
    (folder / "camera.pkl").write_bytes(python2_pickle(values))
    with h5py.File(folder / "masks.hdf5", "w") as file:
        file.create_dataset("masks", data=recording.masks.astype(np.int8), compression="lzf")
    if recording.keypoints:
        with h5py.File(folder / "keypoints.hdf5", "w") as file:
            file.create_dataset("keypoints", data=np.zeros((count, 54), np.float32))
    pose, translation = recording.pose.reshape(-1, 72), recording.translation
    if recording.surplus == "end":
        pose, translation = (np.concatenate([part, part[-1:]]) for part in (pose, translation))
    if recording.surplus == "start":
        pose, translation = (np.concatenate([part[:1], part]) for part in (pose, translation))
    with h5py.File(folder / "reconstructed_poses.hdf5", "w") as file:
        file.create_dataset("pose", data=pose.astype(np.float32))
        file.create_dataset("trans", data=translation.astype(np.float32))
        file.create_dataset("betas", data=(recording.shape + 0.5).astype(np.float32))
    consensus = {"betas": recording.shape, "v_personal": recording.offsets}
    (folder / "consensus.pkl").write_bytes(python2_pickle(consensus))
    return folder


def _filmed(vertices, model: SmplModel, camera: Camera):
    """The picture and mask that the lens gives of a body before a room."""
    wide = _wide_pinhole(camera)
    raster = rasterise(vertices, model.faces, wide)
    colours = 0.5 + 0.5 * np.sin(9 * model.template / np.ptp(model.template[:, 1]))
    colours = (40 + 200 * colours).astype(np.float32)
    picture = interpolate(raster, model.faces, colours).clip(0, 255).astype(np.uint8)
    places = _where_ideal(camera, wide)
    seen = cv2.remap(raster.covered.astype(np.uint8), *places, cv2.INTER_NEAREST) > 0
    bent = cv2.remap(picture, *places, cv2.INTER_NEAREST)
    return np.where(seen[..., None], bent, room(camera.width, camera.height)), seen


def _wide_pinhole(camera: Camera) -> Camera:
    wide = replace(camera, K=camera.K.copy(), distortion=np.zeros(5))
    margin = np.array([(WIDER - 1) / 2 * camera.width, (WIDER - 1) / 2 * camera.height])
    wide.K[:2, 2] += margin
    width, height = round(camera.width * WIDER), round(camera.height * WIDER)
    return replace(wide, width=width, height=height).resized(FINER * width, FINER * height)


def _where_ideal(camera: Camera, wide: Camera):
    """For each pixel of the bent picture its place in the wide ideal one, as cv2 counts."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    centres = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2).astype(np.float64)
    K = camera.K.copy()
    K[:2, 2] -= 0.5
    rays = cv2.undistortPoints(centres, K, camera.distortion).reshape(-1, 2)
    homogeneous = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
    places = (homogeneous @ wide.K.T)[:, :2] - 0.5
    grid = places.reshape(camera.height, camera.width, 2).astype(np.float32)
    return grid[..., 0].copy(), grid[..., 1].copy()
