from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.crop import Crop, crop_around
from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.metrics.score import EvaluationConfig, protocol, score_view

CONFIGURATION = EvaluationConfig()


@pytest.fixture
def view() -> tuple[np.ndarray, np.ndarray, Crop]:
    rng = np.random.default_rng(0)
    photograph = rng.integers(0, 256, (40, 30, 3), dtype=np.uint8)
    mask = np.zeros((40, 30), bool)
    mask[8:32, 10:20] = True
    return photograph, mask, crop_around(mask, 28)


def test_the_photograph_cut_out_on_white_scores_perfectly(view: tuple) -> None:
    photograph, mask, crop = view
    render = np.where(mask[..., None], photograph / 255.0, 1.0)
    scores = score_view(render, mask.astype(float), photograph, mask, crop, CONFIGURATION)
    assert scores["mask_iou"] == 1.0
    assert scores["ssim"] == pytest.approx(1.0)
    assert min(scores["psnr"], scores["psnr_union"], scores["psnr_image"]) > 100


def test_what_the_photograph_shows_outside_the_mask_changes_nothing(view: tuple) -> None:
    photograph, mask, crop = view
    render, opacity = np.full((40, 30, 3), 0.7), mask * 0.9
    other = np.where(mask[..., None], photograph, 255 - photograph)
    first = score_view(render, opacity, photograph, mask, crop, CONFIGURATION)
    assert first == score_view(render, opacity, other, mask, crop, CONFIGURATION)


def test_the_union_counts_what_was_rendered_beside_the_person(view: tuple) -> None:
    photograph, mask, crop = view
    render = np.where(mask[..., None], photograph / 255.0, 1.0)
    opacity = mask.astype(float)
    render[0, :10], opacity[0, :10] = 0.0, 1.0
    scores = score_view(render, opacity, photograph, mask, crop, CONFIGURATION)
    wrong, union = 10, mask.sum() + 10
    assert scores["psnr_union"] == pytest.approx(-10 * np.log10(wrong / union))
    assert scores["mask_iou"] == pytest.approx(mask.sum() / union)


def test_crop_and_image_scores_are_psnr_of_their_pixels(view: tuple) -> None:
    photograph, mask, crop = view
    truth = np.where(mask[..., None], photograph / 255.0, 1.0)
    render = np.clip(truth + 0.05, 0, 1)
    scores = score_view(render, mask * 1.0, photograph, mask, crop, CONFIGURATION)
    box = np.s_[crop.top : crop.top + crop.side, crop.left : crop.left + crop.side]
    assert scores["psnr_image"] == pytest.approx(psnr(render, truth), rel=1e-5)
    assert crop.left >= 0
    assert scores["psnr"] == pytest.approx(psnr(render[box], truth[box]), rel=1e-5)


def test_an_empty_truth_mask_and_a_render_with_nan_are_refused(view: tuple) -> None:
    photograph, mask, crop = view
    render, opacity = np.ones((40, 30, 3)), np.zeros((40, 30))
    with pytest.raises(InputError, match="empty mask"):
        score_view(render, opacity, photograph, mask & False, crop, CONFIGURATION)
    with pytest.raises(InputError, match="finite"):
        score_view(render * np.nan, opacity, photograph, mask, crop, CONFIGURATION)


def test_the_protocol_names_crop_background_threshold_and_version() -> None:
    text = protocol(CONFIGURATION, 118, ["scene rotated by 3 degrees"])
    for fact in ("118 px", "512/1080", "white", "opacity above 0.5", "scikit-image", "rotated"):
        assert fact in text


def test_every_field_that_changes_a_score_changes_the_protocol() -> None:
    changes = {
        "crop_reference_px": 256,
        "crop_reference_height_px": 540,
        "crop_box_margin": 1.5,
        "opacity_threshold": 0.4,
    }
    before = protocol(CONFIGURATION, 118)
    for name, value in changes.items():
        assert protocol(EvaluationConfig(**{name: value}), 118) != before
