from __future__ import annotations

import pytest

from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.report.seed_summary import summarise

MOCOFLOW = Contender("turn", "fast", "mocoflow")
TRAIN = {"turn": "cam00"}


def rows(metric: str, *values: float, camera: str = "cam01") -> list[ScoreRow]:
    return [
        ScoreRow("turn", "mocoflow", 0, camera, frame, metric, value, "white")
        for frame, value in enumerate(values)
    ]


def test_each_seed_counts_once_however_many_views_it_has():
    runs = {MOCOFLOW: {0: rows("psnr", 20.0, 22.0), 1: rows("psnr", 24.0), 2: rows("psnr", 18.0)}}
    summary = summarise(runs, TRAIN)[MOCOFLOW]["psnr"]
    assert summary == (pytest.approx(21.0), 18.0, 24.0, 3)


def test_a_view_of_the_train_camera_counts_only_where_there_is_no_other():
    seen = rows("psnr", 30.0, camera="cam00")
    novel = rows("psnr", 20.0)
    assert summarise({MOCOFLOW: {0: seen + novel}}, TRAIN)[MOCOFLOW]["psnr"].mean == 20.0
    assert summarise({MOCOFLOW: {0: seen}}, TRAIN)[MOCOFLOW]["psnr"].mean == 30.0


def test_errors_of_the_motion_are_medians_over_frames():
    runs = {MOCOFLOW: {0: rows("keypoint_mm", 1.0, 2.0, 99.0, camera="cam00")}}
    assert summarise(runs, TRAIN)[MOCOFLOW]["keypoint_mm"].mean == 2.0


def test_a_metric_that_one_seed_lacks_says_how_many_have_it():
    runs = {MOCOFLOW: {0: rows("psnr", 20.0) + rows("ssim", 0.9), 1: rows("psnr", 21.0)}}
    summaries = summarise(runs, TRAIN)[MOCOFLOW]
    assert (summaries["psnr"].seeds, summaries["ssim"].seeds) == (2, 1)
    assert "mask_iou" not in summaries
