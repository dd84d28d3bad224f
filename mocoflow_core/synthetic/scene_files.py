"""A native scene folder, written piece by piece; scene.json comes last and makes it whole."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.whole_file import whole_file

_COMPRESSION = [cv2.IMWRITE_PNG_COMPRESSION, 1]  # Writing is as fast as rendering; 1 is enough.


class SceneFiles:
    """Writes the files of one scene, each whole or not at all.

    Raises InputError if the folder holds anything already, and where the disk is full.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(
                "A scene is written into a new or empty folder",
                f"{folder} with content",
                "Choose another folder or empty it first.",
            )
        self._folder = folder

    def write_background(self, camera: Camera, rgb: NDArray[np.uint8]) -> None:
        self._write_png(f"background/{camera.name}.png", rgb[..., ::-1])

    def write_picture(
        self, camera: Camera, frame_index: int, rgb: NDArray[np.uint8], mask: NDArray[np.bool_]
    ) -> None:
        """One frame (H, W, 3) and its mask (H, W)."""
        self._write_png(f"frames/{camera.name}/{frame_index:06d}.png", rgb[..., ::-1])
        self._write_png(f"masks/{camera.name}/{frame_index:06d}.png", mask.astype(np.uint8) * 255)

    def write_meshes(self, meshes: MeshSequence) -> None:
        with self._whole("meshes.npz") as path:
            meshes.save(path)

    def write_truth(
        self,
        frame_indices: NDArray[np.int32],
        vertices: NDArray[np.float64],
        faces: NDArray[np.int32],
        keypoints3d: NDArray[np.float64],
    ) -> None:
        """The rendered surface (T, V, 3), (F, 3), the COCO keypoints (T, 17, 3), world metres."""
        with self._whole("truth.npz") as path, path.open("wb") as file:
            np.savez(
                file,
                frame_indices=frame_indices,
                vertices=vertices.astype(np.float32),
                faces=faces,
                keypoints3d=keypoints3d.astype(np.float32),
            )

    def write_description(
        self, name: str, fps: float, cameras: list[Camera], located: bool, attribution: str
    ) -> None:
        """scene.json; the first camera is the train camera."""
        description = {
            "format": "mocoflow-scene",
            "version": 1,
            "name": name,
            "fps": fps,
            "world": {"unit": "m", "up": "+z"},
            "train_camera": cameras[0].name,
            "cameras": {
                camera.name: camera.to_json()
                | {
                    "frames": f"frames/{camera.name}",
                    "masks": f"masks/{camera.name}",
                    "background": f"background/{camera.name}.png",
                }
                for camera in cameras
            },
            "meshes": {
                "file": "meshes.npz",
                "coordinates": "world" if located else "camera-root-centred",
                "located": located,
                "source": "synthetic",
            },
            "truth": {"file": "truth.npz"},
            "license": "CC0-1.0",
            "attribution": attribution,
        }
        with self._whole("scene.json") as path:
            path.write_text(json.dumps(description, indent=1) + "\n")

    def _write_png(self, name: str, pixels: NDArray[np.uint8]) -> None:
        encoded = cv2.imencode(".png", np.ascontiguousarray(pixels), _COMPRESSION)[1]
        with self._whole(name) as path:
            path.write_bytes(encoded.tobytes())

    @contextmanager
    def _whole(self, name: str) -> Iterator[Path]:
        path = self._folder / name
        with full_disk_is_bad_input(f"The folder {self._folder}"):
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as beside:
                yield beside
