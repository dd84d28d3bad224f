from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.misalignment import (
    MISPLACEMENTS,
    SHIFTS_PX,
    TURNS_DEG,
    misalignment_rows,
    read_misalignment,
    write_misalignment,
)
from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.metrics.score import EvaluationConfig, on_white

CONFIG = EvaluationConfig()
SIDE = 128


def person(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A striped block of 96 x 32 pixels in a picture of 192 x 192."""
    mask = np.zeros((192, 192), bool)
    mask[48:144, 80:112] = True
    rgb = np.random.default_rng(seed).integers(0, 256, (24, 24, 3)).repeat(8, 0).repeat(8, 1)
    return rgb.astype(np.uint8), mask


@pytest.fixture(scope="module")
def rows():
    return misalignment_rows("block", [person()], SIDE, CONFIG)


def values(rows, metric: str, kind: str) -> list[float]:
    return [row.value for row in rows if (row.metric, row.misplaced) == (metric, kind)]


def test_every_displacement_of_the_paper_has_every_score(rows):
    assert [m.amount for m in MISPLACEMENTS] == [*SHIFTS_PX, *TURNS_DEG]
    assert len(rows) == len(MISPLACEMENTS) * 3
    assert {row.metric for row in rows} == {"psnr", "ssim", "psnr_union"}
    assert all(np.isfinite(row.value) for row in rows)


@pytest.mark.parametrize("metric", ["psnr", "ssim", "psnr_union"])
def test_a_step_away_from_the_truth_is_seen_by_every_score(rows, metric):
    for kind in ("shifted", "turned"):
        found = values(rows, metric, kind)
        assert found[0] > found[-1]


def test_pixels_are_those_of_the_paper_s_crop_and_the_row_says_those_of_this_picture(rows):
    shifted = {row.amount: row.moved_px for row in rows if row.misplaced == "shifted"}
    assert shifted == {px: px * SIDE / 512 for px in SHIFTS_PX}
    assert all(row.moved_px is None for row in rows if row.misplaced == "turned")
    assert f"{SIDE}/512" in rows[0].protocol


def test_a_shift_by_whole_pixels_is_one(rows):
    rgb, mask = person()
    truth = on_white(rgb, mask)
    # 40 px of the paper's crop are 10 of this one.
    expected = []
    for axis, step in ((1, 10), (1, -10), (0, 10), (0, -10)):
        moved, covered = np.roll(truth, step, axis), np.roll(mask, step, axis)
        expected.append(psnr(moved, truth, covered | mask))
    assert values(rows, "psnr_union", "shifted")[3] == pytest.approx(np.mean(expected), abs=1e-4)


def test_a_crop_of_white_flatters_and_the_union_does_not(rows):
    for kind in ("shifted", "turned"):
        pairs = zip(values(rows, "psnr", kind), values(rows, "psnr_union", kind), strict=True)
        assert all(crop > union for crop, union in pairs)


def test_a_disc_of_one_colour_may_turn_about_its_middle():
    y, x = np.mgrid[:192, :192]
    mask = (y - 95.5) ** 2 + (x - 95.5) ** 2 < 40**2
    rgb = np.full((192, 192, 3), 90, np.uint8)
    turned = values(misalignment_rows("disc", [(rgb, mask)], SIDE, CONFIG), "psnr", "turned")
    # Only its rim is drawn anew: at worst every pixel of it half-way to white.
    rim, off = 2 * np.pi * 40, 0.5 * (255 - 90) / 255
    assert min(turned) > -10 * np.log10(rim * off**2 / SIDE**2)


def test_without_views_there_are_no_rows():
    assert misalignment_rows("nobody", [], SIDE, CONFIG) == []


def test_the_table_survives_its_file(rows, tmp_path):
    write_misalignment(rows, tmp_path / "misalignment.parquet")
    assert read_misalignment(tmp_path / "misalignment.parquet") == rows
