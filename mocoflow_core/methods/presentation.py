"""Moving pictures for people: the same frames from the side, and a turntable."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.orbit import moved_around
from mocoflow_core.io.pictures import as_bytes, write_picture
from mocoflow_core.io.video import write_video
from mocoflow_core.progress import Progress
from mocoflow_core.rendering.trained_scene import TrainedScene


class PresentationConfig(ConfigurationPart):
    """What is shown besides the scored views."""

    side_deg: float = Field(90.0, description="The novel view: so far around the body, degrees.")
    turntable_views: int = Field(36, ge=2, description="Pictures of one full turn.")
    correspondence_frames: int = Field(
        5, ge=1, description="Frames whose points are coloured, besides the canonical one."
    )
    turntable_fps: float = Field(12.0, gt=0, description="Pictures per second of the turntable.")


def render_side_view(
    scene: TrainedScene,
    clip: Clip,
    up: ArrayLike,
    configuration: PresentationConfig,
    folder: Path,
    progress: Progress,
) -> None:
    """Every frame of the clip from the side, as ``%06d.png`` with the source numbers."""
    turn = np.radians(configuration.side_deg) * np.asarray(up, np.float64)
    for row, (frame_index, time) in enumerate(zip(clip.frame_indices, clip.times, strict=True)):
        camera = moved_around(clip.camera, turn, scene.space.centre_at(float(time)))
        rgb, _ = scene.render(camera, float(time))
        write_picture(folder / f"{frame_index:06d}.png", as_bytes(rgb))
        progress((row + 1) / len(clip.frame_indices), f"side view of frame {frame_index}")


def render_turntable(
    scene: TrainedScene,
    clip: Clip,
    up: ArrayLike,
    configuration: PresentationConfig,
    path: Path,
    progress: Progress,
) -> None:
    """One turn around the body while the whole clip plays, as a video."""
    rows = np.linspace(0, len(clip.times) - 1, configuration.turntable_views).round().astype(int)
    times = clip.times[rows]

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for number, camera in enumerate(orbit(scene, clip.camera, up, times)):
            rgb, _ = scene.render(camera, float(times[number]))
            progress((number + 1) / len(times), f"turntable view {number + 1}")
            yield as_bytes(rgb)

    write_video(path, pictures(), configuration.turntable_fps)


def orbit(
    scene: TrainedScene, camera: Camera, up: ArrayLike, times: NDArray[np.float64]
) -> Iterator[Camera]:
    """One full turn around the upright axis through the body, a camera for each time.

    The first camera is the given one; the body keeps its place in the image as it walks.
    """
    for number, time in enumerate(times):
        angle = 2.0 * np.pi * number / len(times)
        turn = angle * np.asarray(up, np.float64)
        yield moved_around(camera, turn, scene.space.centre_at(float(time)))
