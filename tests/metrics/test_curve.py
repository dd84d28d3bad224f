from __future__ import annotations

from pathlib import Path

import pytest
from pyarrow import parquet

from mocoflow_core.metrics.curve import (
    CLOCKED_STAGES,
    CurveRow,
    as_error,
    read_curve,
    seconds_to_target,
    training_spans,
    write_curve,
)


def at(seconds: float, value: float, metric: str = "psnr") -> CurveRow:
    return CurveRow(
        "turn", "mocoflow", 0, "optimise_scene", 10, seconds, 2 * seconds, metric, value
    )


TASKS = Path(__file__).parents[2] / "tasks"
ROWS = [at(1, 18.0), at(2, 21.0), at(4, 20.5), at(8, 24.0), at(8, 0.9, "ssim")]


def test_a_curve_comes_back_as_it_was_written(tmp_path: Path) -> None:
    write_curve(ROWS, tmp_path / "error_curve.parquet")
    assert read_curve(tmp_path / "error_curve.parquet") == ROWS
    names = parquet.read_schema(tmp_path / "error_curve.parquet").names
    assert names == "scene method seed stage step wall_s cpu_s metric value".split()


def test_every_error_falls_as_its_score_gets_better() -> None:
    assert as_error("psnr_union", 20.0) == pytest.approx(0.01)
    assert as_error("ssim", 0.9) == pytest.approx(0.1)
    assert as_error("mask_iou", 1.0) == 0.0
    assert as_error("keypoint_mm", 42.0) == 42.0


def test_time_to_target_is_the_first_time_that_is_good_enough() -> None:
    assert seconds_to_target(ROWS, "psnr", 20.5) == 2
    assert seconds_to_target(ROWS, "psnr", 24.0) == 8
    assert seconds_to_target(ROWS, "ssim", 0.85) == 8


def test_a_target_that_was_never_reached_has_no_time() -> None:
    assert seconds_to_target(ROWS, "psnr", 30.0) is None


def test_spans_touch_follow_the_run_and_leave_evaluation_out() -> None:
    stages = [
        {"name": "optimise_scene", "wall_s": 30.0, "cpu_s": 40.0, "cached": False},
        {"name": "extract_clip", "wall_s": 2.0, "cpu_s": 3.0, "cached": True},
        {"name": "score_views", "wall_s": 9.0, "cpu_s": 9.0, "cached": False},
    ]
    spans = training_spans(stages)
    assert [span.name for span in spans] == ["extract_clip", "optimise_scene"]
    assert [(span.start_s, span.end_s) for span in spans] == [(0.0, 2.0), (2.0, 32.0)]
    assert training_spans(stages, "cpu_s")[-1].end_s == 43.0


def test_the_clock_counts_stages_that_exist() -> None:
    assert [name for name in CLOCKED_STAGES if not (TASKS / f"{name}.py").is_file()] == []
