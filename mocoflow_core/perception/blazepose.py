"""BlazePose behind the interfaces of perception: boxes, keypoints, masks of persons."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.perception.blazepose_detector import REGION_MARGIN, BlazePoseDetector
from mocoflow_core.perception.blazepose_landmarks import BlazePoseLandmarks, Pose
from mocoflow_core.perception.person import Boxes, Keypoints, Picture
from mocoflow_core.perception.region import Region

PRESENT = 0.5
# Of a box's longer side: what the detector looks at to find the person of that box.
LOOK_AROUND = 1.6


class BlazePose:
    """Bazarevsky et al. 2020, the heavy landmark network; Apache-2.0."""

    def __init__(self, device: str = "cpu") -> None:
        self.detector = BlazePoseDetector(device)
        self.landmarks = BlazePoseLandmarks(device)
        self.name = "BlazePose-heavy"
        both = self.detector.digest + self.landmarks.digest
        self.digest = hashlib.sha256(both.encode()).hexdigest()

    def boxes(self, images: Sequence[Picture]) -> list[Boxes]:
        """Squares about the persons' circles, which reach beyond the body."""
        found = self.detector.detect(images, [Region.of_picture(image) for image in images])
        return [
            Boxes(
                np.array([person.circle.corners for person in persons], np.float32).reshape(-1, 4),
                np.array([person.confidence for person in persons], np.float32),
            )
            for persons in found
        ]

    def keypoints(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[Keypoints | None]:
        return [
            pose.keypoints if pose.presence >= PRESENT else None
            for pose in self.poses(images, boxes)
        ]

    def masks(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[NDArray[np.float32]]:
        return [
            pose.mask(*image.shape[:2])
            for pose, image in zip(self.poses(images, boxes), images, strict=True)
        ]

    def poses(self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]) -> list[Pose]:
        """The person of the box (4,) of each picture, turned upright before it is looked at."""
        around = [Region.of_box(box, LOOK_AROUND) for box in boxes]
        found = self.detector.detect(images, around)
        regions = [
            persons[0].circle.widened(REGION_MARGIN) if persons else Region.of_box(box)
            for persons, box in zip(found, boxes, strict=True)
        ]
        return self.landmarks.poses(images, regions)
