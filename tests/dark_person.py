"""A detector that is exact and cheap: dark pixels are the person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocoflow_core.perception.person import COCO17, Boxes, Keypoints


class DarkPerson:
    """The box of the dark pixels; keypoints along its diagonal."""

    name = "dark pixels"
    digest = "0" * 64

    def boxes(self, images: Sequence[np.ndarray]) -> list[Boxes]:
        return [self._boxes(image) for image in images]

    def keypoints(
        self, images: Sequence[np.ndarray], boxes: Sequence[np.ndarray]
    ) -> list[Keypoints | None]:
        steps = np.linspace(0, 1, len(COCO17))[:, None]
        confidence = np.ones(len(COCO17), np.float32)
        return [Keypoints(box[:2] + steps * (box[2:] - box[:2]), confidence) for box in boxes]

    def _boxes(self, image: np.ndarray) -> Boxes:
        y, x = np.nonzero(image.mean(axis=2) < 128)
        corners = [[x.min(), y.min(), x.max() + 1, y.max() + 1]] if len(x) else []
        found = np.array(corners, np.float32).reshape(-1, 4)
        return Boxes(found, np.ones(len(found), np.float32))
