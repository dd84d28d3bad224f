"""Masks of AIST videos, which come with none: the user's own, or the difference to the plate."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.background import (
    background_plate,
    masks_from_plate,
    plate_without_masks,
)
from mocoflow_core.capture.frame_source import FrameSource, Image, numbered_images, read_mask
from mocoflow_core.datasets.aist_time import GridFrames
from mocoflow_core.datasets.dataset_scene import Mask, MaskSource
from mocoflow_core.datasets.mask_sources import ImageMasks

# Growth of what differs from the plate before the plate is taken from the rest, share of the
# longer side.
PLATE_MARGIN = 0.015


@dataclass(frozen=True, eq=False)
class DifferenceMasks:
    """The largest region of each frame that differs from the plate, shadows with it."""

    frames: FrameSource
    plate: Image  # (H, W, 3)
    threshold: int  # 1/255

    @property
    def indices(self) -> NDArray[np.int32]:
        return self.frames.indices

    @property
    def files(self) -> list[Path]:
        return self.frames.files

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        for number, image in self.frames.read(wanted):
            yield number, masks_from_plate(image[None], self.plate, self.threshold)[0]


def masks_in_folder(folder: Path, frames: GridFrames) -> ImageMasks:
    """A user's masks ``%06d.png`` of a video, numbered as its frames decode, by tick.

    Above 127 is the person. Ticks whose frame has no mask are missing.

    Raises InputError where the folder is missing or a name is no number.
    """
    files = numbered_images(folder, f"masks of {folder.name}")
    shown = frames.shown(frames.indices.tolist())
    images = {tick: files[frame] for tick, frame in shown.items() if frame in files}
    return ImageMasks(images, lambda path: read_mask(path) > 127)


def clip_plate(frames: FrameSource, masks: MaskSource | None, count: int, threshold: int) -> Image:
    """The median background (H, W, 3) over ``count`` frames, spread over the clip."""
    numbers = frames.indices if masks is None else masks.indices
    rows = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    chosen = numbers[rows].tolist()
    pictures = np.stack([image for _, image in frames.read(chosen)])
    margin_px = round(PLATE_MARGIN * max(pictures.shape[1:3]))
    if masks is None:
        return plate_without_masks(pictures, threshold, margin_px)
    people = np.stack([mask for _, mask in masks.read(chosen)])
    return background_plate(pictures, people, margin_px)
