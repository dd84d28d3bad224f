"""How much boxes overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def overlaps(box: NDArray[np.floating], boxes: NDArray[np.floating]) -> NDArray[np.float64]:
    """Intersection over union (N,) of a box (4,) x0 y0 x1 y1 with boxes (N, 4)."""
    inner = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])
    shared = inner.clip(0).prod(axis=1).astype(np.float64)
    areas = (box[2:] - box[:2]).prod() + (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return shared / np.maximum(areas - shared, 1e-12)


def most_overlapping(box: NDArray[np.floating], boxes: NDArray[np.floating]) -> int | None:
    """The row of the box that overlaps most; None where none does."""
    shares = overlaps(box, boxes)
    return int(shares.argmax()) if shares.size and shares.max() > 0 else None
