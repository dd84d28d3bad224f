from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.mask_iou import mask_iou


def square(left: int) -> np.ndarray:
    mask = np.zeros((10, 20), bool)
    mask[2:8, left : left + 6] = True
    return mask


def test_iou_is_one_for_equal_and_zero_for_disjoint_masks() -> None:
    assert mask_iou(square(3), square(3)) == 1.0
    assert mask_iou(square(0), square(10)) == 0.0


def test_a_square_shifted_by_half_its_side_overlaps_by_a_third() -> None:
    assert mask_iou(square(3), square(6)) == pytest.approx(1 / 3)


def test_two_empty_masks_agree() -> None:
    empty = np.zeros((4, 4), bool)
    assert mask_iou(empty, empty) == 1.0
