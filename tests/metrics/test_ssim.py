from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.ssim import K1, K2, SIGMA_PX, WINDOW_PX, ssim


def ssim_by_its_formula(image: np.ndarray, reference: np.ndarray) -> float:
    """Wang et al. 2004, Eq. 13, window by window, written as loops over pixels."""
    offsets = np.arange(WINDOW_PX) - WINDOW_PX // 2
    profile = np.exp(-(offsets**2) / (2 * SIGMA_PX**2))
    window = np.outer(profile, profile)
    window /= window.sum()
    values = []
    height, width, channels = image.shape
    for channel in range(channels):
        for y in range(height - WINDOW_PX + 1):
            for x in range(width - WINDOW_PX + 1):
                a = image[y : y + WINDOW_PX, x : x + WINDOW_PX, channel]
                b = reference[y : y + WINDOW_PX, x : x + WINDOW_PX, channel]
                mean_a, mean_b = (window * a).sum(), (window * b).sum()
                var_a = (window * (a - mean_a) ** 2).sum()
                var_b = (window * (b - mean_b) ** 2).sum()
                cov = (window * (a - mean_a) * (b - mean_b)).sum()
                luminance = (2 * mean_a * mean_b + K1**2) / (mean_a**2 + mean_b**2 + K1**2)
                contrast = (2 * cov + K2**2) / (var_a + var_b + K2**2)
                values.append(luminance * contrast)
    return float(np.mean(values))


def test_ssim_follows_the_formula_of_the_paper() -> None:
    rng = np.random.default_rng(0)
    reference = rng.random((17, 19, 3))
    image = np.clip(reference + 0.2 * rng.normal(size=reference.shape), 0, 1)
    # scikit-image cuts its Gaussian at the same 11 pixels, so only rounding is left.
    assert ssim(image, reference) == pytest.approx(ssim_by_its_formula(image, reference), abs=1e-9)


def test_ssim_of_equal_images_is_one_and_it_is_symmetric() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.random((16, 16, 3)), rng.random((16, 16, 3))
    assert ssim(a, a) == pytest.approx(1.0)
    assert ssim(a, b) == pytest.approx(ssim(b, a))
    assert ssim(a, b) < 1.0


def test_ssim_is_defined_on_the_smallest_crop() -> None:
    assert np.isfinite(ssim(np.zeros((WINDOW_PX, WINDOW_PX, 3)), np.ones((11, 11, 3))))
