"""Overlap of two silhouettes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def mask_iou(mask: NDArray[np.bool_], reference: NDArray[np.bool_]) -> float:
    """Intersection over union of two boolean masks of one shape; 1 when both are empty."""
    union = np.count_nonzero(mask | reference)
    return np.count_nonzero(mask & reference) / union if union else 1.0
