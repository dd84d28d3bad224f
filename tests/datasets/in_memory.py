"""Frames, masks and whole data sets that lie in memory, for whatever does not ask for files."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.datasets.dataset_scene import DatasetCamera, DatasetMeshes, DatasetScene
from tests.capsule_person import look_at, room, walking


@dataclass
class MemoryFrames:
    """Frames or masks by number."""

    pictures: dict[int, np.ndarray]
    files = ()
    fps = None

    @property
    def indices(self):
        return np.array(sorted(self.pictures), np.int32)

    def read(self, wanted):
        for number in sorted(wanted):
            yield number, self.pictures[number]


def walking_dataset(frames=9, first=20, width=64, height=96) -> DatasetScene:
    """A capsule person that walks, seen by two cameras; frames are numbered from ``first``."""
    meshes = walking(frames)
    meshes = replace(meshes, frame_indices=meshes.frame_indices + np.int32(first))
    cameras = {}
    for name, eye in {"front": [0, -3.5, 1.2], "side": [3.5, 0, 1.2]}.items():
        camera = look_at(eye, [0, 0, 0.9], 1.5 * height, width, height, name)
        masks = silhouettes(meshes.vertices, meshes.faces, camera)
        plate = room(width, height)
        red = np.uint8([230, 30, 40])
        cameras[name] = DatasetCamera(
            camera,
            MemoryFrames(
                {
                    first + row: np.where(mask[..., None], red, plate)
                    for row, mask in enumerate(masks)
                }
            ),
            MemoryFrames({first + row: mask for row, mask in enumerate(masks)}),
            plate,
        )
    return DatasetScene(
        name="walking",
        fps=24.0,
        up="+z",
        train_camera="front",
        cameras=cameras,
        meshes=DatasetMeshes(meshes, "world", True, "capsules"),
        truth=None,
        license="none",
        attribution="capsules",
        working_fps=12.0,
    )


def with_camera(scene: DatasetScene, name: str, **changes) -> DatasetScene:
    """The scene with parts of a recorded camera changed."""
    changed = replace(scene.cameras[name], **changes)
    return replace(scene, cameras={**scene.cameras, name: changed})
