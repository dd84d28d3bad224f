from __future__ import annotations

import numpy as np

from mocoflow_core.metrics.plausibility import person_box
from mocoflow_core.perception.person import Boxes

PICTURE_PX = 10_000.0


def boxes(*found: tuple[float, float]) -> Boxes:
    """Boxes 10 px wide of (height, confidence)."""
    corners = [[0.0, 0.0, 10.0, height] for height, _ in found]
    confidence = [confidence for _, confidence in found]
    return Boxes(np.array(corners, np.float32).reshape(-1, 4), np.array(confidence, np.float32))


def test_nothing_found_is_no_person():
    assert person_box(boxes(), PICTURE_PX, 0.5, 0.05) is None


def test_both_thresholds_must_be_reached_by_the_same_box():
    assert person_box(boxes((90.0, 0.4), (20.0, 0.9)), PICTURE_PX, 0.5, 0.05) is None
    assert person_box(boxes((50.0, 0.5)), PICTURE_PX, 0.5, 0.05) is not None


def test_of_several_persons_the_most_confident_counts():
    box = person_box(boxes((60.0, 0.7), (80.0, 0.8), (20.0, 0.9)), PICTURE_PX, 0.5, 0.05)
    assert box.tolist() == [0.0, 0.0, 10.0, 80.0]
