"""Masks of a followed person, steady in time and sharp at the edges."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.background import background_plate
from mocoflow_core.capture.frame_source import FrameSource, Image
from mocoflow_core.perception.blazepose_landmarks import Pose
from mocoflow_core.perception.person import PersonSegmenter
from mocoflow_core.progress import Progress
from mocoflow_core.video.followed_person import FollowedPerson

Mask = NDArray[np.bool_]  # (H, W)
Probability = NDArray[np.float32]  # (H, W)

# The network alone decides where it is sure; between, so does the difference to the plate.
SURELY_NOT, SURELY = 0.08, 0.85
# What it is unsure of is the median of neighbouring frames, where they are no further apart.
LONGEST_STEP_S = 0.05
# Pieces below this share of the largest are no part of the person; holes below it are filled.
SMALLEST_PIECE = 0.03
SMALLEST_HOLE = 0.002
# Edges are smoothed over 3 pixels, or 5 in pictures whose longer side is at least this.
LARGE_PICTURE = 640
# Masks are grown by this share of the longer side before the plate is made.
PLATE_MARGIN = 0.015


@dataclass(frozen=True, eq=False)
class PackedMasks:
    """Masks in memory, a bit a pixel."""

    indices: NDArray[np.int32]  # (N,) source numbers, ascending
    packed: list[NDArray[np.uint8]]
    shape: tuple[int, int]  # height and width

    @property
    def files(self) -> list[Path]:
        return []

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        for row in np.flatnonzero(np.isin(self.indices, sorted(wanted))):
            yield int(self.indices[row]), self.at(int(row))

    def at(self, row: int) -> Mask:
        """The mask of a row."""
        height, width = self.shape
        return np.unpackbits(self.packed[row], count=height * width).reshape(self.shape) > 0


def rough_masks(person: FollowedPerson, rows: NDArray[np.integer], size: tuple[int, int]) -> Mask:
    """(N, H, W): what the network alone takes for the person, with all it is unsure of."""
    width, height = size
    return np.stack([person.poses[row].mask(height, width) > SURELY_NOT for row in rows])


def make_plate(
    frames: FrameSource,
    person: FollowedPerson,
    usable: NDArray[np.bool_],
    size: tuple[int, int],
    most: int,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], Mask]:
    """The background (H, W, 3), and the frames (N, H, W, 3) and masks that it is made of.

    ``usable``: (T,) frames that may be looked at, the first among them.
    """
    shown = np.flatnonzero(usable & person.seen)
    spread = np.linspace(0, len(shown) - 1, min(most, len(shown))).round().astype(int)
    rows = shown[np.unique(spread)]
    pictures = np.stack([picture for _, picture in frames.read(frames.indices[rows].tolist())])
    masks = rough_masks(person, rows, size)
    return background_plate(pictures, masks, round(PLATE_MARGIN * max(size))), pictures, masks


def mask_person(
    frames: FrameSource,
    rate: float,
    person: FollowedPerson,
    usable: NDArray[np.bool_],
    plate: NDArray[np.uint8],
    least_difference: int,
    progress: Progress,
    segmenter: PersonSegmenter | None = None,
) -> PackedMasks:
    """A mask for every frame, from the network and the difference to the plate.

    Masks of ``usable`` frames (T,) come from such frames alone, those of held-out ones from all. A
    ``segmenter`` takes the place of the network that found the pose, where it finds the person.
    """
    shape = plate.shape[:2]
    reach = int(rate * LONGEST_STEP_S)
    packed = []
    for row, (_, picture) in enumerate(frames.read(frames.indices.tolist())):
        around = [person.poses[near] for near in neighbours(row, usable, reach)]
        probability = _steady(person.poses[row], around, shape)
        if segmenter is not None:
            probability = _segmented(segmenter, picture, person.poses[row], probability)
        if not person.seen[row]:
            probability = np.full_like(probability, 0.5) * (probability > 0)
        mask = refine(probability, picture, plate, least_difference)
        packed.append(np.packbits(mask))
        progress((row + 1) / len(person.poses), "masks")
    return PackedMasks(frames.indices, packed, (shape[0], shape[1]))


def refine(
    probability: Probability, picture: Image, plate: NDArray[np.uint8], least_difference: int
) -> Mask:
    """The person (H, W): what is sure, and what is unsure and differs from the plate."""
    difference = cv2.medianBlur(cv2.absdiff(picture, plate).max(axis=-1), 3)
    doubtful = (probability > SURELY_NOT) & (difference > least_difference)
    mask = ((probability > SURELY) | doubtful).astype(np.uint8)
    side = 3 if max(mask.shape) < LARGE_PICTURE else 5
    mask = cv2.medianBlur(mask, side)
    return _without_holes(_without_pieces(mask))


def neighbours(row: int, usable: NDArray[np.bool_], reach: int) -> list[int]:
    """The rows before and after one that may help it; none where one of them is out of reach."""
    may_help = np.flatnonzero(usable) if usable[row] else np.arange(len(usable))
    place = int(np.searchsorted(may_help, row))
    if not 0 < place < len(may_help) - 1:
        return []
    found = [int(may_help[place - 1]), int(may_help[place + 1])]
    return found if found[1] - row <= reach and row - found[0] <= reach else []


def _steady(pose: Pose, around: list[Pose], shape: tuple[int, ...]) -> Probability:
    """The network's probability, the median with its neighbours where it is unsure."""
    here = pose.mask(shape[0], shape[1])
    if not around:
        return here
    unsure = (here > SURELY_NOT) & (here < SURELY)
    beside = [near.mask(shape[0], shape[1])[unsure] for near in around]
    here[unsure] = np.median(np.stack([here[unsure], *beside]), axis=0)
    return here


def _segmented(
    segmenter: PersonSegmenter, picture: Image, pose: Pose, otherwise: Probability
) -> Probability:
    """What a segmenter says of the person of a pose; where it sees nobody, what was said before."""
    places = pose.keypoints.places
    box = np.concatenate((places.min(axis=0), places.max(axis=0)))
    (found,) = segmenter.masks([picture], [box])
    return found if found.any() else otherwise


def _without_pieces(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The largest piece and those of some size."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    if count < 2:
        return mask
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    kept = areas >= SMALLEST_PIECE * areas.max()
    kept[0] = False
    return kept[labels].astype(np.uint8)


def _without_holes(mask: NDArray[np.uint8]) -> Mask:
    """Small holes are filled; those between arm and body stay."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - mask, connectivity=4)
    filled = stats[:, cv2.CC_STAT_AREA] < SMALLEST_HOLE * max(int(mask.sum()), 1)
    filled[0] = False
    return (mask > 0) | filled[labels]
