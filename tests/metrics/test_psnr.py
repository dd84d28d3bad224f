from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.psnr import psnr


def test_a_constant_offset_of_a_tenth_is_20_decibels() -> None:
    reference = np.full((5, 7, 3), 0.4)
    assert psnr(reference + 0.1, reference) == pytest.approx(20.0)


def test_equal_images_are_infinitely_good() -> None:
    image = np.linspace(0, 1, 27).reshape(3, 3, 3)
    assert psnr(image, image) == np.inf


def test_halving_the_error_gains_six_decibels() -> None:
    rng = np.random.default_rng(0)
    reference, error = rng.random((8, 8, 3)), rng.normal(size=(8, 8, 3))
    gain = psnr(reference + error / 2, reference) - psnr(reference + error, reference)
    assert gain == pytest.approx(20 * np.log10(2))


def test_pixels_outside_the_region_do_not_count() -> None:
    reference = np.zeros((4, 4, 3))
    image = reference + 0.1
    region = np.zeros((4, 4), bool)
    region[1:3, 1:3] = True
    spoiled = np.where(region[..., None], image, 1.0)
    assert psnr(spoiled, reference, region) == pytest.approx(20.0)


def test_a_white_border_flatters_the_whole_image_and_not_the_region() -> None:
    image, reference = np.ones((20, 20, 3)), np.ones((20, 20, 3))
    region = np.zeros((20, 20), bool)
    region[5:15, 5:15] = True
    image[region] = 0.5
    # A quarter of the pixels is wrong, so the whole image looks 10 log10(4) better.
    gain = psnr(image, reference) - psnr(image, reference, region)
    assert gain == pytest.approx(10 * np.log10(4))


def test_unequal_sizes_and_empty_regions_are_refused() -> None:
    with pytest.raises(InputError, match="shape"):
        psnr(np.zeros((4, 4, 3)), np.zeros((5, 4, 3)))
    with pytest.raises(InputError, match="empty"):
        psnr(np.zeros((4, 4, 3)), np.zeros((4, 4, 3)), np.zeros((4, 4), bool))
