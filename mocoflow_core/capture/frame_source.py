"""Where the frames of a camera come from: a video file or a folder of numbered images."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.video import VideoDescription, describe_video, read_frames

Image = NDArray[np.uint8]  # (H, W, 3) sRGB-encoded
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")


class FrameSource(Protocol):
    """Frames by their source number."""

    @property
    def indices(self) -> NDArray[np.int32]:
        """All source numbers, ascending."""

    @property
    def files(self) -> list[Path]:
        """The files that hold them."""

    @property
    def fps(self) -> float | None:
        """The rate that the files themselves state."""

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        """The wanted frames one at a time, ascending."""


@dataclass(frozen=True)
class VideoFrames:
    """Frames of a video, numbered from 0 in the order they decode."""

    path: Path

    @cached_property
    def _description(self) -> VideoDescription:
        return describe_video(self.path)

    @property
    def indices(self) -> NDArray[np.int32]:
        return np.arange(self._description.frame_count, dtype=np.int32)

    @property
    def files(self) -> list[Path]:
        return [self.path]

    @property
    def fps(self) -> float | None:
        return self._description.fps or None

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        return read_frames(self.path, wanted)


@dataclass(frozen=True)
class ImageFrames:
    """Frames in a folder, named by their source numbers."""

    images: dict[int, Path]

    @cached_property
    def indices(self) -> NDArray[np.int32]:
        return np.array(sorted(self.images), dtype=np.int32)

    @property
    def files(self) -> list[Path]:
        return [self.images[index] for index in sorted(self.images)]

    @property
    def fps(self) -> float | None:
        return None

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        for index in sorted(wanted):
            yield index, read_image(self.images[index])


def open_frame_source(path: Path, what: str) -> FrameSource:
    """A folder of ``000000.png`` (or ``.jpg``) files, or a video file.

    Raises InputError when there is neither.
    """
    if path.is_file():
        return VideoFrames(path)
    images = numbered_images(path, what)
    if not images:
        raise InputError(f"{what} must hold images", f"none in {path.name}", "Add the frames.")
    return ImageFrames(images)


def numbered_images(folder: Path, what: str) -> dict[int, Path]:
    """Images of a folder by the number that names them."""
    if not folder.is_dir():
        raise InputError(f"{what} must be a folder of images", f"{folder.name}", "Add the folder.")
    images: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in IMAGE_SUFFIXES:
            continue
        if not path.stem.isdecimal() or int(path.stem) in images:
            raise InputError(
                f"{what} must be named by their source numbers, each once, as in 000012.png",
                path.name,
                "Rename or remove the file.",
            )
        images[int(path.stem)] = path
    return images


def read_image(path: Path) -> Image:
    """An RGB image (H, W, 3). Raises InputError when it cannot be decoded."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise _undecodable(path)
    return np.ascontiguousarray(image[..., ::-1])


def read_mask(path: Path) -> Image:
    """A mask (H, W) as bytes: above 127 is the person. Files of 1 bit are decoded to 0 and 255.

    Raises InputError when it cannot be decoded, or when its values stay below 128.
    """
    mask = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if mask is None:
        raise _undecodable(path)
    highest = int(mask.max())
    if 0 < highest <= 127:
        raise InputError(
            "masks must hold values above 127 on the person",
            f"values up to {highest} in {path.parent.name}/{path.name}",
            "Store masks with 0 and 255.",
        )
    return mask.astype(np.uint8, copy=False)


def _undecodable(path: Path) -> InputError:
    name = f"{path.parent.name}/{path.name}"
    return InputError("an image that can be decoded", name, "Write the file again as PNG or JPEG.")
