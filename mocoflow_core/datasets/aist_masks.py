"""Masks and plates of AIST videos, which come with neither."""

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
from mocoflow_core.capture.shadows import shadow
from mocoflow_core.datasets.aist_time import GridFrames
from mocoflow_core.datasets.body_regions import BodyRegion, BodyRegions
from mocoflow_core.datasets.dataset_scene import Mask, MaskSource
from mocoflow_core.datasets.mask_sources import ImageMasks

# Growth of what differs from the plate before the plate is taken from the rest, share of the
# longer side.
PLATE_MARGIN = 0.015


@dataclass(frozen=True)
class PlateChoice:
    """How many frames make a plate, and what differs from it, in 1/255."""

    frames: int
    threshold: int


@dataclass(frozen=True, eq=False)
class DifferenceMasks:
    """The largest region of each frame that differs from the plate.

    Where bodies are known: only near them; what has the plate's colour with less light, a shadow,
    only on them; and well inside them whatever the colour.
    """

    frames: FrameSource
    plate: Image  # (H, W, 3)
    threshold: int  # 1/255
    bodies: BodyRegions | None = None

    @property
    def indices(self) -> NDArray[np.int32]:
        return self.frames.indices

    @property
    def files(self) -> list[Path]:
        return self.frames.files

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        for number, image in self.frames.read(wanted):
            if self.bodies is None or number not in self.bodies.numbers:
                yield number, differs_from(self.plate, image, self.threshold)
            else:
                yield number, person_near(self.bodies.at(number), self.plate, image, self.threshold)


def differs_from(plate: Image, image: Image, threshold: int) -> Mask:
    """The largest region (H, W) of one frame that differs from the plate."""
    mask: Mask = masks_from_plate(image[None], plate, threshold)[0]
    return mask


def person_near(body: BodyRegion, plate: Image, image: Image, threshold: int) -> Mask:
    """The person (H, W) in one frame, looked for near a body alone."""
    mask = np.zeros(body.near.shape, bool)
    if not body.near.any():
        return mask
    rows, columns = (np.flatnonzero(body.near.any(axis=axis)) for axis in (1, 0))
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    seen, empty = image[part], plate[part]
    person = body.near[part] & ~shadow(seen, body.on[part], empty)
    differs = differs_from(empty, np.where(person[..., None], seen, empty), threshold)
    mask[part] = differs | body.inside[part]
    return mask


def masks_in_folder(folder: Path, frames: GridFrames) -> ImageMasks:
    """A user's masks ``%06d.png`` of a video, numbered as its frames decode, by tick.

    Above 127 is the person. Ticks whose frame has no mask are missing.

    Raises InputError where the folder is missing or a name is no number.
    """
    files = numbered_images(folder, f"masks of {folder.name}")
    shown = frames.shown(frames.indices.tolist())
    images = {tick: files[frame] for tick, frame in shown.items() if frame in files}
    return ImageMasks(images, lambda path: read_mask(path) > 127)


def clip_plate(
    frames: FrameSource,
    masks: MaskSource | None,
    bodies: BodyRegions | None,
    choice: PlateChoice,
    among: NDArray[np.int32],
) -> Image:
    """The median background (H, W, 3) over some of the frames ``among``, spread over them.

    Held-out frames are none of these: the plate is learned from.

    Masks say where the person is; else bodies do, for who dances on the spot is part of a plain
    median; without either the person is what moves.
    """
    known = np.intersect1d(frames.indices, among)
    if masks is not None:
        known = np.intersect1d(known, masks.indices)
    elif bodies is not None:
        known = np.intersect1d(known, bodies.numbers)
    rows = np.linspace(0, len(known) - 1, min(choice.frames, len(known))).round().astype(int)
    chosen = known[rows].tolist()
    pictures = np.stack([image for _, image in frames.read(chosen)])
    margin_px = round(PLATE_MARGIN * max(pictures.shape[1:3]))
    if masks is not None:
        people = np.stack([mask for _, mask in masks.read(chosen)])
        return background_plate(pictures, people, margin_px)
    if bodies is not None:
        people = np.stack([bodies.at(number).near for number in chosen])
        return background_plate(pictures, people, margin_px=0)
    return plate_without_masks(pictures, choice.threshold, margin_px)
