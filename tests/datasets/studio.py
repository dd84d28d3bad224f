"""A capsule person in a studio with cameras all around, in the axes that a data set has."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.geometry.camera import Camera
from tests.capsule_person import look_at, room, walking

# From z up to the world of ZJU-MoCap (z down) and of AIST++ (y up), both right-handed.
Z_DOWN = np.diag([1.0, -1.0, -1.0])
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
# Light clothes in a dark grey room: videos keep half of the resolution of colours only.
CLOTHES = np.uint8([230, 215, 200])


@dataclass(frozen=True, eq=False)
class Studio:
    """What the cameras see, and the truth behind it."""

    meshes: MeshSequence
    cameras: dict[str, Camera]
    plates: dict[str, np.ndarray]  # (H, W, 3)
    masks: dict[str, np.ndarray]  # (T, H, W)

    def frames(self, name: str) -> np.ndarray:
        """(T, H, W, 3)."""
        return np.where(self.masks[name][..., None], CLOTHES, self.plates[name])


def studio(names, world, meshes=None, width=64, height=96, frames=6) -> Studio:
    """Cameras on a ring, the first in front, with distortion; ``world``: z up -> the data set's."""
    cameras = {}
    for row, name in enumerate(names):
        angle = -np.pi / 2 + 2 * np.pi * row / len(names)
        eye = [3.5 * np.cos(angle), 3.5 * np.sin(angle), 1.9]
        camera = look_at(eye, [0, 0, 0.9], 1.3 * height, width, height, name)
        cameras[name] = replace(camera, R=camera.R @ world.T)
    meshes = meshes or walking(frames)
    meshes = replace(meshes, vertices=(meshes.vertices @ world.T).astype(np.float32))
    plates = {
        name: (room(width, height, seed)[..., :1] // 2).repeat(3, axis=-1)
        for seed, name in enumerate(names)
    }
    masks = {
        name: silhouettes(meshes.vertices, meshes.faces, camera) for name, camera in cameras.items()
    }
    return Studio(meshes, cameras, plates, masks)


def bent(studio: Studio, distortion) -> Studio:
    """The same calibration with lens distortion; pictures stay, as only its numbers matter."""
    cameras = {
        name: replace(camera, distortion=np.array(distortion))
        for name, camera in studio.cameras.items()
    }
    return replace(studio, cameras=cameras)
