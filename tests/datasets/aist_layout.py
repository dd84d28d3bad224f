"""Writes AIST's videos and the annotations of AIST++ from a synthetic studio."""

from __future__ import annotations

import json
import pickle
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from mocoflow_core.io.video import write_video
from tests.datasets.studio import Studio

SEQUENCE = "gWA_sFM_cAll_d27_mWA5_ch20"


@dataclass(frozen=True)
class AistLayout:
    """One of the variants; tests change a field to plant a trap."""

    sequence: str = SEQUENCE
    setting: str = "setting10_2"
    fps: float = 60.0
    missing_videos: tuple[str, ...] = ()  # cameras
    shrunk_to: tuple[int, int] | None = None  # width, height of the videos
    backwards: bool = False  # cameras listed in another order
    ignored: tuple[str, ...] = ()


AS_RELEASED = AistLayout()


def write_aist(
    folder: Path,
    studio: Studio,
    motion: dict | None,
    keypoints_cm: dict | None = None,
    layout: AistLayout = AS_RELEASED,
) -> Path:
    """``videos/`` flat, ``annotations/`` in its tree; the studio is in metres, y up."""
    (folder / "videos").mkdir(parents=True)
    annotations = folder / "annotations"
    for part in ("cameras", "motions", "keypoints3d"):
        (annotations / part).mkdir(parents=True)
    for name in studio.cameras:
        if name not in layout.missing_videos:
            video = folder / f"videos/{layout.sequence.replace('cAll', name)}.mp4"
            write_video(video, [_sized(frame, layout) for frame in studio.frames(name)], layout.fps)
    mapping = f"gBR_sBM_cAll_d04_mBR0_ch01 setting1\n{layout.sequence}\t{layout.setting}\n"
    (annotations / "cameras/mapping.txt").write_text(mapping)
    write_cameras(annotations / f"cameras/{layout.setting}.json", studio, layout.backwards)
    for part, content in (("motions", motion), ("keypoints3d", keypoints_cm)):
        if content is not None:
            with (annotations / part / f"{layout.sequence}.pkl").open("wb") as file:
                pickle.dump(content, file, protocol=4)
    (annotations / "ignore_list.txt").write_text("\n".join(layout.ignored) + "\n")
    return folder


def write_cameras(file: Path, studio: Studio, backwards: bool = False) -> None:
    """A setting's cameras: OpenCV pixels, Rodrigues vectors, centimetres."""
    listed = [
        {
            "name": name,
            "size": [camera.width, camera.height],
            "matrix": (camera.K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]).tolist(),
            "rotation": Rotation.from_matrix(camera.R).as_rotvec().tolist(),
            "translation": (100 * camera.t).tolist(),
            "distortions": camera.distortion.tolist(),
        }
        for name, camera in studio.cameras.items()
    ]
    file.write_text(json.dumps(listed[::-1] if backwards else listed))


def _sized(frame: np.ndarray, layout: AistLayout) -> np.ndarray:
    if layout.shrunk_to is None:
        return frame
    return cv2.resize(frame, layout.shrunk_to, interpolation=cv2.INTER_AREA)
