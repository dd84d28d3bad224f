"""Persons that one network finds in a whole picture, box by box, behind the usual interfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from mocoflow_core.errors import InputError
from mocoflow_core.perception.overlap import most_overlapping
from mocoflow_core.perception.person import COCO17, Boxes, Keypoints, Picture

PERSON = 1  # torchvision's number of COCO's class; 0 is the background.
LEAST_CONFIDENCE = 0.05
# What torchvision's detectors call what they give.
BOXES, LABELS, SCORES = "boxes", "labels", "scores"
MASKS, KEYPOINTS, KEYPOINT_SCORES = "masks", "keypoints", "keypoints_scores"
OF_MASK_RCNN = (BOXES, LABELS, SCORES, MASKS)
OF_KEYPOINT_RCNN = (BOXES, LABELS, SCORES, KEYPOINTS, KEYPOINT_SCORES)
TITLES = {OF_MASK_RCNN: "Mask R-CNN", OF_KEYPOINT_RCNN: "Keypoint R-CNN"}

Found = Mapping[str, NDArray[Any]]


class InstanceNetwork(Protocol):
    """A detector of torchvision's kind, however it is run."""

    @property
    def file(self) -> str:
        """Name of its file."""

    @property
    def digest(self) -> str: ...

    @property
    def gives(self) -> tuple[str, ...]:
        """``OF_MASK_RCNN`` or ``OF_KEYPOINT_RCNN``."""

    def find(self, image: Picture) -> Found:
        """What it gives for a picture (H, W, 3), N instances of all classes, by name."""


@dataclass(frozen=True, eq=False)
class Instances:
    """Persons of one picture, most confident first."""

    boxes: Boxes
    masks: NDArray[np.float32] | None  # (N, H, W) in [0, 1]
    keypoints: list[Keypoints] | None


class InstanceDetector:
    """Finds boxes with any such network, masks with a Mask R-CNN, keypoints with the other."""

    def __init__(self, network: InstanceNetwork) -> None:
        self._network = network
        self.name = f"{TITLES[network.gives]} {network.file}"
        self.digest = network.digest

    def boxes(self, images: Sequence[Picture]) -> list[Boxes]:
        """Persons of each picture from a confidence of 0.05 on."""
        return [self._look(image).boxes for image in images]

    def keypoints(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[Keypoints | None]:
        """The points of the person whose box overlaps the asked one most.

        Confidences are the logistic function of the network's scores, which know no bounds.
        """
        found: list[Keypoints | None] = []
        for image, box in zip(images, boxes, strict=True):
            seen = self._look(image)
            row = most_overlapping(box, seen.boxes.corners)
            found.append(None if row is None or seen.keypoints is None else seen.keypoints[row])
        return found

    def masks(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[NDArray[np.float32]]:
        """The mask of the person whose box overlaps the asked one most; zero without any."""
        found = []
        for image, box in zip(images, boxes, strict=True):
            seen = self._look(image)
            row = most_overlapping(box, seen.boxes.corners)
            empty = np.zeros(image.shape[:2], np.float32)
            found.append(empty if row is None or seen.masks is None else seen.masks[row])
        return found

    def _look(self, image: Picture) -> Instances:
        return persons_of(self._network.find(image), image.shape[:2])


def persons_of(found: Found, size: tuple[int, int]) -> Instances:
    """The persons among instances in a picture (H, W).

    Raises InputError where the arrays are not those of such a network.
    """
    _check(found, size)
    scores = found[SCORES].astype(np.float32)
    rows = np.flatnonzero((found[LABELS] == PERSON) & (scores >= LEAST_CONFIDENCE))
    rows = rows[np.argsort(-scores[rows], kind="stable")]
    boxes = Boxes(found[BOXES][rows].astype(np.float32), scores[rows])
    masks, keypoints = None, None
    if MASKS in found:
        masks = found[MASKS][rows, 0].astype(np.float32)
    if KEYPOINTS in found:
        # COCO counts the middle of the first pixel as 0.
        places = found[KEYPOINTS][rows, :, :2].astype(np.float32) + np.float32(0.5)
        confidence = expit(found[KEYPOINT_SCORES][rows].astype(np.float32))
        keypoints = [Keypoints(*pair) for pair in zip(places, confidence, strict=True)]
    return Instances(boxes, masks, keypoints)


def _check(found: Found, size: tuple[int, int]) -> None:
    count = len(found[SCORES])
    shapes: dict[str, tuple[int, ...]] = {
        BOXES: (count, 4),
        LABELS: (count,),
        SCORES: (count,),
        MASKS: (count, 1, *size),
        KEYPOINTS: (count, len(COCO17), 3),
        KEYPOINT_SCORES: (count, len(COCO17)),
    }
    for name, values in found.items():
        if values.shape != shapes[name] or not np.isfinite(values).all():
            raise InputError(
                f"{name} {shapes[name]} of {count} instances, finite",
                f"{values.shape}",
                "Give a detector of torchvision that was trained on COCO.",
            )
