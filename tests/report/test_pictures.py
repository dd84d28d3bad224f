from __future__ import annotations

import io

import numpy as np
from PIL import Image

from mocoflow_core.report.pictures import difference_picture, fitted, webps_within


def test_equal_pictures_differ_in_white_and_larger_differences_are_darker() -> None:
    reference = np.full((4, 6, 3), 100, np.uint8)
    levels = [
        difference_picture(reference + np.uint8(d), reference).mean() for d in (0, 20, 60, 120)
    ]
    assert levels[0] == 255
    assert levels == sorted(levels, reverse=True)


def test_pictures_keep_their_shape_when_they_are_fitted() -> None:
    picture = np.zeros((300, 100, 3), np.uint8)
    assert fitted(picture, 300) is picture
    assert fitted(picture, 150).shape == (150, 50, 3)
    assert fitted(picture[:120, :40], 300).shape == (240, 80, 3)
    assert fitted(picture[:120, :40], 60).shape == (60, 20, 3)


def test_pictures_shrink_until_they_fit_together() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (4, 200, 200, 3), dtype=np.uint8)
    free, tight = webps_within(noise, 10**9), webps_within(noise, 60_000)
    assert Image.open(io.BytesIO(free[0])).size == (240, 240)
    assert sum(map(len, tight)) <= 60_000
