"""The views that are scored, rendered by each method into picture files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.pictures import as_bytes, read_picture, write_picture
from mocoflow_core.methods.posed_mesh import ColouredMesh
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.metrics.views import spread_frames
from mocoflow_core.progress import Progress
from mocoflow_core.rendering.posed_scene import PosedScene
from mocoflow_core.rendering.trained_scene import TrainedScene

Image = NDArray[np.float32]


class ScoredView(NamedTuple):
    """One photograph that a render is compared with."""

    clip: Clip
    row: int

    @property
    def camera(self) -> Camera:
        return self.clip.camera

    @property
    def frame_index(self) -> int:
        return int(self.clip.frame_indices[self.row])

    @property
    def name(self) -> str:
        """Path of its picture below ``views`` and ``opacity``."""
        return f"{self.camera.name}/{self.frame_index:06d}.png"


class Renderer(Protocol):
    """A method that shows the person to any camera at a source frame."""

    def render(self, camera: Camera, frame_index: int) -> tuple[Image, Image]:
        """rgb (H, W, 3) over white and opacity (H, W), both in [0, 1]."""


class TrainedRenderer:
    """The trained scene, asked by source frame numbers."""

    def __init__(self, scene: TrainedScene, clip: Clip) -> None:
        self.scene = scene
        self._first = int(clip.frame_indices[0])
        self._length = max(int(clip.frame_indices[-1]) - self._first, 1)

    def time(self, frame_index: float) -> float:
        """Normalised time of a source frame number, which may lie between frames."""
        return (frame_index - self._first) / self._length

    def at(self, frame_index: float) -> PosedScene:
        """The scene at a source frame number."""
        return self.scene.at(self.time(frame_index))

    def render(self, camera: Camera, frame_index: int) -> tuple[Image, Image]:
        return self.scene.render(camera, self.time(frame_index))


class PosedMeshRenderer:
    """The baseline: the coloured mesh in the pose that the estimate gives."""

    def __init__(self, mesh: ColouredMesh, meshes: MeshSequence) -> None:
        self._mesh = mesh
        self._vertices = dict(zip(meshes.frame_indices.tolist(), meshes.vertices, strict=True))

    def render(self, camera: Camera, frame_index: int) -> tuple[Image, Image]:
        return self._mesh.render(camera, self._vertices[frame_index])


class Pictures:
    """Views that were rendered before, read from their files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def render(self, camera: Camera, frame_index: int) -> tuple[Image, Image]:
        name = f"{camera.name}/{frame_index:06d}.png"
        rgb = read_picture(self._folder / "views" / name)
        opacity = read_picture(self._folder / "opacity" / name)
        return rgb.astype(np.float32) / 255.0, opacity.astype(np.float32) / 255.0


def load_clips(folder: Path) -> list[Clip]:
    """The evaluation cameras' clips, a folder each, by name."""
    return [Clip.load(path) for path in sorted(folder.iterdir()) if path.is_dir()]


def scored_views(
    clip: Clip, evaluation: Sequence[Clip], configuration: EvaluationConfig
) -> list[ScoredView]:
    """Held-out frames of the train camera, then frames of the others, evenly spread in time."""
    views = []
    for seen in (clip, *evaluation):
        rows = np.flatnonzero(seen.held_out & seen.has_mask & seen.masks.any(axis=(1, 2)))
        for frame in spread_frames(seen.frame_indices[rows], configuration.frames_per_camera):
            views.append(ScoredView(seen, int(np.searchsorted(seen.frame_indices, frame))))
    return views


def render_views(
    renderer: Renderer, views: Sequence[ScoredView], folder: Path, progress: Progress
) -> None:
    """Write ``views/<camera>/%06d.png`` and ``opacity/<camera>/%06d.png`` into the folder."""
    for number, view in enumerate(views):
        rgb, opacity = renderer.render(view.camera, view.frame_index)
        write_picture(folder / "views" / view.name, as_bytes(rgb))
        write_picture(folder / "opacity" / view.name, as_bytes(opacity))
        progress((number + 1) / len(views), view.name)
