from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.metrics.perceptual import LpipsAlex


@pytest.fixture(scope="module")
def lpips() -> LpipsAlex:
    return LpipsAlex()


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    coarse = np.random.default_rng(0).uniform(0, 1, (8, 8, 3)).astype(np.float32)
    return np.clip(cv2.resize(coarse, (96, 96), interpolation=cv2.INTER_CUBIC), 0, 1)


def distance(lpips: LpipsAlex, first: np.ndarray, second: np.ndarray) -> float:
    return lpips.distance(lpips.features(first), lpips.features(second))


def test_equal_pictures_are_at_no_distance(lpips, picture):
    assert distance(lpips, picture, picture.copy()) == 0.0


def test_the_distance_is_symmetric_and_grows_with_the_blur(lpips, picture):
    blurred = [cv2.GaussianBlur(picture, (0, 0), sigma) for sigma in (1.0, 3.0, 9.0)]
    found = [distance(lpips, picture, image) for image in blurred]
    assert 0.0 < found[0] < found[1] < found[2]
    assert distance(lpips, blurred[2], picture) == pytest.approx(found[2])


def test_a_shift_costs_less_than_noise_of_the_same_squared_error(lpips, picture):
    shifted = np.roll(picture, 2, axis=1)
    error = np.sqrt(np.mean((shifted - picture) ** 2))
    noise = np.random.default_rng(1).normal(0, error, picture.shape).astype(np.float32)
    assert distance(lpips, shifted, picture) < 0.5 * distance(lpips, picture + noise, picture)


def test_features_have_unit_length_and_small_pictures_enough_cells(lpips, picture):
    for layer in lpips.features(picture[:20, :30]):
        length = layer.square().sum(dim=0)
        assert min(layer.shape[1:]) >= 3
        assert ((length - 1).abs() < 1e-4).float().mean() > 0.9
