"""What is behind the person: a plate from the frames, and masks from a plate."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.progress import Progress, part_of, untold

Frames = NDArray[np.uint8]  # (T, H, W, 3)
Masks = NDArray[np.bool_]  # (T, H, W), true on the person
# Sorts behind every colour.
_NEVER_SEEN = np.uint16(256)
INPAINT_RADIUS_PX = 3


def background_plate(
    frames: Frames, masks: Masks, margin_px: int, progress: Progress = untold
) -> NDArray[np.uint8]:
    """Median colour (H, W, 3) over the frames in which the person does not cover the pixel.

    Masks are grown by ``margin_px`` because their edges are uncertain; pixels seen only closer to
    the person are taken with smaller margins, and those never seen are filled from around.
    """
    passes = margin_px.bit_length() + 1
    plate, unseen = _masked_median(frames, _grown(masks, margin_px))
    progress(1 / passes, "background plate")
    while margin_px > 0 and unseen.any():
        margin_px //= 2
        closer, still_unseen = _masked_median(frames, _grown(masks, margin_px))
        plate[unseen] = closer[unseen]
        unseen &= still_unseen
        progress(1 - margin_px.bit_length() / passes, "background plate")
    if not unseen.any():
        return plate
    filled = cv2.inpaint(plate, unseen.astype(np.uint8), INPAINT_RADIUS_PX, cv2.INPAINT_TELEA)
    return filled.astype(np.uint8, copy=False)


def plate_without_masks(
    frames: Frames, threshold: int, margin_px: int, progress: Progress = untold
) -> NDArray[np.uint8]:
    """The plate (H, W, 3) of frames whose person is known from nothing but moving on.

    The median over all frames first; then the median over those that lie within ``threshold`` of
    it (the largest difference over the channels, 1/255; grown by ``margin_px``), which what passed
    by no longer biases. Where the same thing is seen in most frames it is taken for background.
    """
    first, _ = _masked_median(frames, np.zeros(frames.shape[:3], bool))
    differs = np.stack([cv2.absdiff(frame, first).max(axis=-1) > threshold for frame in frames])
    progress(0.3, "background plate")
    return background_plate(frames, differs, margin_px, part_of(progress, 0.3, 1.0))


def covered_share(masks: Masks) -> float:
    """Share of the picture that the person covers in every frame: a plate must guess there."""
    return float(masks.all(axis=0).mean())


def masks_from_plate(
    frames: Frames, plate: NDArray[np.uint8], threshold: int, progress: Progress = untold
) -> Masks:
    """The largest region of each frame that differs from the plate by more than ``threshold``.

    The difference is the largest over the channels, in steps of 1/255.
    """
    masks = np.empty(frames.shape[:3], bool)
    for row, frame in enumerate(frames):
        masks[row] = _largest_difference(frame, plate, threshold)
        progress((row + 1) / len(frames), "masks from the background")
    return masks


def _grown(masks: Masks, margin_px: int) -> Masks:
    side = 2 * margin_px + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.stack([cv2.dilate(mask.astype(np.uint8), kernel) > 0 for mask in masks])


def _masked_median(frames: Frames, covered: Masks) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Median over uncovered frames, row by row to bound memory; and where there is none."""
    count, height, width, _ = frames.shape
    plate = np.zeros((height, width, 3), np.uint8)
    seen = count - covered.sum(axis=0)
    for row in range(height):
        values = np.where(covered[:, row, :, None], _NEVER_SEEN, frames[:, row])
        values = np.sort(values.transpose(1, 2, 0), axis=-1)
        middle = np.maximum(seen[row] - 1, 0) // 2
        lower = np.take_along_axis(values, middle[:, None, None], axis=-1)[..., 0]
        plate[row] = np.where(seen[row, :, None] > 0, lower, 0)
    return plate, seen == 0


def _largest_difference(
    frame: NDArray[np.uint8], plate: NDArray[np.uint8], threshold: int
) -> NDArray[np.bool_]:
    differs = (cv2.absdiff(frame, plate).max(axis=-1) > threshold).astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    closed = cv2.morphologyEx(differs, cv2.MORPH_CLOSE, kernel)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
    if count < 2:
        return np.zeros(differs.shape, bool)
    return labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
