"""Which points of the body belong together over time, as pictures: same colour, same point.

Every pixel's surface point is carried to canonical space and takes its place there as its colour,
as in the paper's figure of dense correspondences.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.pictures import as_bytes, write_picture
from mocoflow_core.methods.rendered_views import TrainedRenderer
from mocoflow_core.metrics.views import spread_frames
from mocoflow_core.progress import Progress
from mocoflow_core.rendering.surface_points import surface_points
from mocoflow_core.rendering.trained_scene import TrainedScene


def write_correspondences(
    scene: TrainedScene,
    clip: Clip,
    canonical_frame: int,
    count: int,
    folder: Path,
    progress: Progress,
) -> None:
    """Write ``%06d.png`` of ``count`` frames, evenly spread, and of the canonical one.

    Args:
        clip: of the train camera, through which the pictures look.
        canonical_frame: source number.
    """
    frames = sorted({canonical_frame, *spread_frames(clip.frame_indices, count)})
    renderer = TrainedRenderer(scene, clip)
    for done, frame in enumerate(frames):
        picture = correspondence_picture(scene, clip.camera, renderer.time(frame))
        write_picture(folder / f"{frame:06d}.png", as_bytes(picture))
        progress((done + 1) / len(frames), f"correspondences of frame {frame}")


@torch.no_grad()
def correspondence_picture(scene: TrainedScene, camera: Camera, time: float) -> NDArray[np.float64]:
    """Colours (H, W, 3) of the points that a camera sees at a normalised time, over white.

    Points that the motion does not know stay white.
    """
    seen = surface_points(scene, camera, time)
    observed = torch.from_numpy(seen.points.astype(np.float32))
    row = torch.zeros(len(observed), dtype=torch.int64)
    canonical, known = scene.at(time).to_canonical(observed, row)
    colours = colours_of_places(canonical.double().numpy(), scene.space.canonical_vertices)
    picture = np.ones((camera.height * camera.width, 3))
    picture[seen.pixels[known.numpy()]] = colours[known.numpy()]
    return picture.reshape(camera.height, camera.width, 3)


def colours_of_places(
    points_canonical: NDArray[np.float64], vertices: NDArray[np.float32]
) -> NDArray[np.float64]:
    """x, y and z within the box of the canonical mesh (V, 3) as red, green and blue, (N, 3)."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return ((points_canonical - lower) / np.maximum(upper - lower, 1e-9)).clip(0.0, 1.0)
