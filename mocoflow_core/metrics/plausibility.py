"""Whether a picture shows what a detector calls a person."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.perception.person import Boxes


def person_box(
    boxes: Boxes, picture_px: float, least_confidence: float, least_area: float
) -> NDArray[np.float32] | None:
    """The most confident box (4,) that counts as a person, or None.

    Plausibility is the share of novel views that have one.

    Args:
        picture_px: pixels of the picture.
        least_confidence: what the detector must give at least.
        least_area: of the box, as a share of the picture.

    Source: MoCo-Flow sec. 4 (share of novel views in which a person is detected).
    """
    sizes = boxes.corners[:, 2:] - boxes.corners[:, :2]
    counts = (boxes.confidence >= least_confidence) & (
        sizes.prod(axis=1) >= least_area * picture_px
    )
    if not counts.any():
        return None
    best = int(np.argmax(np.where(counts, boxes.confidence, -np.inf)))
    return np.asarray(boxes.corners[best])
