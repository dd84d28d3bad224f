"""Frames, masks and background of a camera as files, brought to the working size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_source import read_image, read_mask
from mocoflow_core.capture.scene import Scene
from mocoflow_core.capture.undistort import WorkingView
from mocoflow_core.errors import InputError
from mocoflow_core.progress import Progress, untold

Indices = NDArray[np.int32]


def working_frames(
    scene: Scene, name: str, indices: Indices, view: WorkingView, progress: Progress = untold
) -> NDArray[np.uint8]:
    """The frames (T, H, W, 3) of those source numbers. Raises InputError for another size."""
    frames = np.empty((len(indices), view.camera.height, view.camera.width, 3), np.uint8)
    for row, (number, picture) in enumerate(scene.frames(name).read(indices.tolist())):
        require_size(picture, view, f"frame {number} of {name}")
        frames[row] = view.image(picture)
        progress((row + 1) / len(indices), f"frame {number} of {name}")
    return frames


def working_masks(
    files: dict[int, Path], indices: Indices, view: WorkingView, progress: Progress = untold
) -> NDArray[np.bool_]:
    """Their masks (T, H, W). Raises InputError for another size."""
    masks = np.empty((len(indices), view.camera.height, view.camera.width), bool)
    for row, index in enumerate(indices.tolist()):
        masks[row] = view.mask(source_mask(files[index], view))
        progress((row + 1) / len(indices), f"mask {index} of {view.camera.name}")
    return masks


def source_mask(file: Path, view: WorkingView) -> NDArray[np.uint8]:
    """A mask (H, W) of 0 to 255 as stored. Raises InputError for another size than the camera's."""
    picture = read_mask(file)
    require_size(picture, view, f"mask {file.name} of {view.camera.name}")
    return picture


def working_plate(scene: Scene, name: str, view: WorkingView) -> NDArray[np.uint8] | None:
    """The background (H, W, 3) that the scene brings, if any. Raises InputError as above."""
    file = scene.background(name)
    if file is None:
        return None
    picture = read_image(file)
    require_size(picture, view, f"background of {name}")
    return view.image(picture)


def require_size(picture: NDArray[np.uint8], view: WorkingView, what: str) -> None:
    """Raise InputError unless the picture has the size that scene.json gives its camera."""
    height, width = picture.shape[:2]
    if (width, height) != (view.source.width, view.source.height):
        raise InputError(
            f"{what} must be {view.source.width} x {view.source.height} as scene.json says",
            f"{width} x {height}",
            "Give the picture that size, or correct width, height and K together.",
        )
