"""What perception finds of a person, and who may find it.

Pixels have the corner origin everywhere: the middle of the first pixel is (0.5, 0.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]  # (H, W, 3) RGB

COCO17: tuple[str, ...] = (
    *("nose", "left_eye", "right_eye", "left_ear", "right_ear"),
    *("left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    *("left_wrist", "right_wrist", "left_hip", "right_hip"),
    *("left_knee", "right_knee", "left_ankle", "right_ankle"),
)


@dataclass(frozen=True, eq=False)
class Boxes:
    """Persons of one picture, most confident first."""

    corners: NDArray[np.float32]  # (N, 4) x0 y0 x1 y1 pixels
    confidence: NDArray[np.float32]  # (N,) in [0, 1]


@dataclass(frozen=True, eq=False)
class Keypoints:
    """The points ``COCO17`` of one person; left and right are the person's own."""

    places: NDArray[np.float32]  # (17, 2) x y pixels
    confidence: NDArray[np.float32]  # (17,) in [0, 1]


@dataclass(frozen=True, eq=False)
class BodyLandmarks:
    """The 33 landmarks of BlazePose of one person."""

    places: NDArray[np.float32]  # (33, 2) x y pixels
    depth: NDArray[np.float32]  # (33,) pixels, relative to the hips, growing away from the camera
    world: NDArray[np.float32]  # (33, 3) metres from the hips' centre: x right, y down, z forward
    visibility: NDArray[np.float32]  # (33,) in [0, 1]


class PersonDetector(Protocol):
    """Finds the persons of pictures."""

    @property
    def name(self) -> str: ...

    @property
    def digest(self) -> str:
        """sha256 of the weights or of the file."""

    def boxes(self, images: Sequence[Picture]) -> list[Boxes]: ...


class KeypointDetector(Protocol):
    """Finds the keypoints of the person inside a box of each picture."""

    @property
    def name(self) -> str: ...

    @property
    def digest(self) -> str: ...

    def keypoints(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[Keypoints | None]:
        """One entry a picture; None where no pose is found. ``boxes``: (4,) x0 y0 x1 y1."""


class PersonSegmenter(Protocol):
    """Finds the pixels of the person inside a box of each picture."""

    @property
    def name(self) -> str: ...

    @property
    def digest(self) -> str: ...

    def masks(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[NDArray[np.float32]]:
        """One (H, W) in [0, 1] a picture. ``boxes``: (4,) x0 y0 x1 y1."""
