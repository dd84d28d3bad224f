"""Laws of distances between outlines."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.body.agreement import (
    is_cut,
    outline_distances,
    outside_distances,
    signed_distance,
)


def square(margin: int, size: int = 40) -> np.ndarray:
    mask = np.zeros((size, size), bool)
    mask[margin:-margin, margin:-margin] = True
    return mask


def test_the_signed_distance_counts_from_the_edge_between_pixels():
    distance = signed_distance(square(10))
    assert distance[20, 9] == 0.5
    assert distance[20, 10] == -0.5
    assert distance[20, 4] == 5.5
    assert np.array_equal(signed_distance(~square(10)), -distance)


def test_equal_masks_are_no_distance_apart():
    assert outline_distances(square(10), square(10)).max() == 0
    assert outside_distances(square(10), square(10)).size == 0


@pytest.mark.parametrize("grown", [1, 2, 4])
def test_a_grown_outline_is_as_far_as_it_was_grown(grown):
    distances = outline_distances(square(10), square(10 + grown))
    # All but the corners, which lie on the diagonal.
    assert np.median(distances) == pytest.approx(grown)
    assert distances.min() == pytest.approx(grown)
    assert np.percentile(outside_distances(square(10), square(10 + grown)), 0) == 0.5


def test_where_the_image_cuts_the_person_is_no_outline():
    cut = np.zeros((40, 40), bool)
    cut[15:] = True
    assert is_cut(cut)
    assert not is_cut(square(10))
    body = cut.copy()
    body[-5:] = False
    assert outline_distances(cut, body).max() <= 1e-6


def test_an_empty_mask_or_body_gives_no_distance():
    empty = np.zeros((40, 40), bool)
    assert outline_distances(empty, square(10)).size == 0
    assert outline_distances(square(10), empty).size == 0
    assert outside_distances(square(10), empty).size == 0
    assert np.isposinf(signed_distance(empty)).all()
