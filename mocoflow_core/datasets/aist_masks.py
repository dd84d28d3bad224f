"""Masks of AIST videos, which come with none: the user's own, or the difference to the plate."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.capture.background import (
    background_plate,
    masks_from_plate,
    plate_without_masks,
)
from mocoflow_core.capture.frame_source import FrameSource, Image, numbered_images, read_mask
from mocoflow_core.datasets.aist_time import GridFrames
from mocoflow_core.datasets.dataset_scene import Mask, MaskSource
from mocoflow_core.datasets.mask_sources import ImageMasks
from mocoflow_core.geometry.camera import Camera

# Growth of what differs from the plate before the plate is taken from the rest, share of the
# longer side.
PLATE_MARGIN = 0.015
# Silhouettes of bodies stand in for masks: at this size, grown for clothes and lens distortion.
SILHOUETTE_SIDE_PX = 384
BODY_MARGIN = 0.03


@dataclass(frozen=True)
class PlateChoice:
    """How many frames make a plate, and what differs from it, in 1/255."""

    frames: int
    threshold: int


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


def body_masks(
    bodies: MeshSequence, camera: Camera, numbers: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Where bodies in world metres cover the picture (T, H, W): about, at a small size, grown.

    Lens distortion is left to the growth.
    """
    scale = min(1.0, SILHOUETTE_SIDE_PX / max(camera.width, camera.height))
    small = camera.resized(round(camera.width * scale), round(camera.height * scale))
    covered = silhouettes(bodies.at(numbers).vertices, bodies.faces, small)
    side = 2 * round(BODY_MARGIN * max(small.width, small.height)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    size = (camera.width, camera.height)
    grown = (cv2.dilate(mask.astype(np.uint8), kernel) for mask in covered)
    return np.stack([cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST) > 0 for mask in grown])


def clip_plate(
    frames: FrameSource,
    camera: Camera,
    masks: MaskSource | None,
    bodies: MeshSequence | None,
    choice: PlateChoice,
) -> Image:
    """The median background (H, W, 3) over some frames, spread over the clip.

    Masks say where the person is; else bodies do, for who dances on the spot is part of a plain
    median; without either the person is what moves.
    """
    known = frames.indices if masks is None else masks.indices
    if masks is None and bodies is not None:
        known = np.intersect1d(known, bodies.frame_indices)
    rows = np.linspace(0, len(known) - 1, min(choice.frames, len(known))).round().astype(int)
    chosen = known[rows]
    pictures = np.stack([image for _, image in frames.read(chosen.tolist())])
    margin_px = round(PLATE_MARGIN * max(pictures.shape[1:3]))
    if masks is not None:
        people = np.stack([mask for _, mask in masks.read(chosen.tolist())])
        return background_plate(pictures, people, margin_px)
    if bodies is not None:
        return background_plate(pictures, body_masks(bodies, camera, chosen), 0)
    return plate_without_masks(pictures, choice.threshold, margin_px)
