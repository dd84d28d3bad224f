"""The files of one People-Snapshot subject: where they are, and what they say."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.opencv_calibration import corner_origin, rotation_matrix
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.untrusted import read_hdf5, read_pickle

Array = NDArray[np.float64]
CAMERA_FILE = "camera.pkl"
MASKS_FILE = "masks.hdf5"
POSES_FILE = "reconstructed_poses.hdf5"
CONSENSUS_FILE = "consensus.pkl"
KEYPOINTS_FILE = "keypoints.hdf5"
REQUIRED = ("<folder's name>.mp4", CAMERA_FILE, MASKS_FILE, POSES_FILE)
VIDEO_ENDINGS = (".mp4", ".mov", ".avi", ".mkv", ".webm")
JOINTS = 24
_AS_DISTRIBUTED = "Take the file as it was distributed."


@dataclass(frozen=True, eq=False)
class TrackedBody:
    """``reconstructed_poses.hdf5``: SMPL's parameters of every tracked frame."""

    pose: Array  # (M, 24, 3) axis-angle
    translation: Array  # (M, 3) metres
    shape: Array  # (10,) as the tracking had it


@dataclass(frozen=True, eq=False)
class ConsensusBody:
    """``consensus.pkl``: the clothed body in its rest pose."""

    shape: Array  # (10,) another one than the tracking's
    offsets: Array  # (V, 3) metres, added to the shaped template before it is posed


@dataclass(frozen=True)
class SnapshotPaths:
    """Where the parts of one subject lie; what is optional may be missing."""

    video: Path
    camera: Path
    masks: Path
    poses: Path
    consensus: Path | None
    keypoints: Path | None

    @property
    def present(self) -> list[Path]:
        """All that there are."""
        parts = (self.video, self.camera, self.masks, self.poses, self.consensus, self.keypoints)
        return [part for part in parts if part]


def find_paths(folder: Path) -> SnapshotPaths:
    """The files of a subject's folder. Raises InputError that names every missing one."""
    if missing := missing_parts(folder):
        raise InputError(
            f"a People-Snapshot subject with {', '.join(REQUIRED)}",
            f"{folder} without {', '.join(missing)}",
            "Give the folder of one subject, such as female-3-casual, as it was unpacked.",
        )
    video = _find_video(folder)
    assert video is not None
    consensus, keypoints = (folder / name for name in (CONSENSUS_FILE, KEYPOINTS_FILE))
    return SnapshotPaths(
        video=video,
        camera=folder / CAMERA_FILE,
        masks=folder / MASKS_FILE,
        poses=folder / POSES_FILE,
        consensus=consensus if consensus.is_file() else None,
        keypoints=keypoints if keypoints.is_file() else None,
    )


def missing_parts(folder: Path) -> list[str]:
    """Which of the required parts a folder lacks."""
    missing = [name for name in REQUIRED[1:] if not (folder / name).is_file()]
    return missing if _find_video(folder) else [REQUIRED[0], *missing]


def _find_video(folder: Path) -> Path | None:
    """The video with the folder's name, or else the only one there."""
    entries = sorted(folder.iterdir()) if folder.is_dir() else []
    videos = [path for path in entries if path.suffix.lower() in VIDEO_ENDINGS]
    named = [path for path in videos if path.stem == folder.resolve().name]
    return named[0] if named else videos[0] if len(videos) == 1 else None


def read_camera(path: Path, name: str) -> Camera:
    """The camera of ``camera.pkl``. Raises InputError where it does not hold one."""
    values = _dictionary(path)
    focal, centre = (_numbers(values, key, (2,), path) for key in ("camera_f", "camera_c"))
    width, height = (int(_numbers(values, key, (), path)) for key in ("width", "height"))
    turn = _numbers(values, "camera_rt", (3,), path)
    if width < 1 or height < 1:
        raise InputError(f"{path.name} must state a size", f"{width} x {height}", _AS_DISTRIBUTED)
    K = np.array([[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]])
    return Camera(
        name=name,
        width=width,
        height=height,
        K=corner_origin(K),
        R=rotation_matrix(turn),
        t=_numbers(values, "camera_t", (3,), path),
        distortion=_numbers(values, "camera_k", (5,), path),
    )


def read_tracked_body(path: Path) -> TrackedBody:
    """The poses of ``reconstructed_poses.hdf5``. Raises InputError where it does not hold them."""
    values = read_hdf5(path)
    pose = _numbers(values, "pose", (None, 3 * JOINTS), path)
    translation = _numbers(values, "trans", (None, 3), path)
    if len(pose) != len(translation):
        raise InputError(
            f"{path.name} must have a trans for each pose",
            f"{len(translation)} for {len(pose)}",
            _AS_DISTRIBUTED,
        )
    shape = _numbers(values, "betas", (None,), path)
    return TrackedBody(pose.reshape(-1, JOINTS, 3), translation, shape)


def read_consensus_body(path: Path) -> ConsensusBody:
    """The body of ``consensus.pkl``. Raises InputError where it does not hold one."""
    values = _dictionary(path)
    return ConsensusBody(
        _numbers(values, "betas", (None,), path), _numbers(values, "v_personal", (None, 3), path)
    )


def count_keypoints(path: Path) -> int:
    """For how many frames ``keypoints.hdf5`` has keypoints."""
    keypoints = read_hdf5(path).get("keypoints")
    return 0 if keypoints is None else len(np.atleast_1d(keypoints))


def _dictionary(path: Path) -> dict[str, Any]:
    values = read_pickle(path)
    if not isinstance(values, dict):
        raise InputError(
            f"{path.name} must hold a dictionary", type(values).__name__, _AS_DISTRIBUTED
        )
    return values


def _numbers(values: dict[str, Any], key: str, shape: tuple[int | None, ...], path: Path) -> Array:
    """Finite numbers of a shape, None standing for any length; (1, 10) is as good as (10,)."""
    if key not in values:
        known = ", ".join(map(str, values)) or "nothing"
        raise InputError(f"{path.name} must hold {key!r}", known, _AS_DISTRIBUTED)
    try:
        array = np.asarray(values[key], np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.ndim != len(shape):
        array = array.squeeze()
    fits = array.ndim == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        size = " x ".join("any" if length is None else str(length) for length in shape) or "1"
        raise InputError(
            f"{key!r} of {path.name} must be {size} finite numbers",
            f"{array.shape}" if not fits else "some that are not finite",
            _AS_DISTRIBUTED,
        )
    return array
