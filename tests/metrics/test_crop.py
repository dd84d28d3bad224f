from __future__ import annotations

import numpy as np

from mocoflow_core.metrics.crop import Crop, bounding_box, crop_around, crop_side


def person(height: int, width: int, box: tuple[int, int, int, int]) -> np.ndarray:
    mask = np.zeros((height, width), bool)
    mask[box[0] : box[2], box[1] : box[3]] = True
    return mask


def test_the_crop_is_centred_on_the_mask() -> None:
    mask = person(100, 80, (20, 30, 60, 50))
    crop = crop_around(mask, 60)
    inside = bounding_box(crop.of(mask, False))
    assert (inside[0] + inside[2], inside[1] + inside[3]) == (60, 60)


def test_every_pixel_of_the_crop_is_the_images_or_the_padding() -> None:
    image = np.arange(12.0).reshape(3, 4)
    square = Crop(top=-2, left=1, side=6).of(image, -1.0)
    expected = np.full((6, 6), -1.0)
    for y in range(3):
        for x in range(1, 4):
            expected[y + 2, x - 1] = image[y, x]
    np.testing.assert_array_equal(square, expected)


def test_a_crop_beyond_the_image_is_all_padding() -> None:
    assert (Crop(top=50, left=0, side=4).of(np.zeros((5, 5, 3)), 1.0) == 1.0).all()


def test_the_side_is_the_larger_of_the_papers_share_and_the_largest_box() -> None:
    small, large = person(100, 100, (0, 0, 10, 20)), person(100, 100, (0, 0, 90, 30))
    assert crop_side([small], reference_share=0.5, box_margin=1.2) == 50
    assert crop_side([small, large], reference_share=0.5, box_margin=1.2) == 108


def test_the_crop_contains_every_person_of_the_scene() -> None:
    rng = np.random.default_rng(0)
    masks = []
    for _ in range(20):
        top, left = rng.integers(0, 40, 2)
        masks.append(
            person(64, 64, (top, left, top + rng.integers(1, 24), left + rng.integers(1, 24)))
        )
    side = crop_side(masks, reference_share=0.1, box_margin=1.2)
    for mask in masks:
        assert crop_around(mask, side).of(mask, False).sum() == mask.sum()


def test_an_empty_mask_does_not_break_the_side() -> None:
    assert crop_side([np.zeros((20, 20), bool)], 0.5, 1.2) == 11
