"""Object keypoint similarity of two poses whose positions do not count."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.perception.person import Keypoints

# COCO's own standard deviations in the order of ``COCO17``, as shares of the object's scale.
SIGMAS = np.array(
    (
        *(0.026, 0.025, 0.025, 0.035, 0.035),  # nose, eyes, ears
        *(0.079, 0.079, 0.072, 0.072, 0.062, 0.062),  # shoulders, elbows, wrists
        *(0.107, 0.107, 0.087, 0.087, 0.089, 0.089),  # hips, knees, ankles
    )
)


def centred_oks(
    pose: Keypoints, reference: Keypoints, area_px: float, least_confidence: float
) -> float:
    """Similarity in [0, 1] of a pose with a reference, each about the mean of its own points.

    The points are those confident in the reference; both means are over them. NaN where there
    are none.

    Args:
        area_px: pixels of the person's true mask, in the same pixels as the poses.

    Source: MoCo-Flow sec. 4 (each pose shifted by its mean); COCO's keypoint evaluation
    (``mean exp(-d^2 / (2 area (2 sigma)^2))``).
    """
    known = reference.confidence >= least_confidence
    if not known.any():
        return float("nan")
    return oks(_about_mean(pose, known), _about_mean(reference, known), area_px, known)


def oks(
    places: NDArray[np.floating],
    reference: NDArray[np.floating],
    area_px: float,
    known: NDArray[np.bool_],
) -> float:
    """COCO's similarity of places (17, 2) px with a reference over the known points (17,)."""
    squares = ((places - reference)[known].astype(np.float64) ** 2).sum(axis=-1)
    variances = (2.0 * SIGMAS[known]) ** 2
    return float(np.exp(-squares / (2.0 * area_px * variances)).mean())


def _about_mean(pose: Keypoints, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    return np.asarray(pose.places - pose.places[known].mean(axis=0), np.float32)
