from __future__ import annotations

from pathlib import Path

import pytest
from pyarrow import parquet

from mocoflow_core.metrics.table import ScoreRow, mean_scores, read_scores, write_scores


def row(method: str, camera: str, frame: int, value: float) -> ScoreRow:
    return ScoreRow("turn", method, 0, camera, frame, "psnr", value, "white")


ROWS = [
    row("mocoflow", "cam01", 0, 20.0),
    row("mocoflow", "cam01", 5, 30.0),
    row("posed_mesh", "cam01", 0, 10.0),
    row("mocoflow", "cam02", 0, 15.0),
]


def test_a_table_comes_back_as_it_was_written(tmp_path: Path) -> None:
    write_scores(ROWS, tmp_path / "scores.parquet")
    assert read_scores(tmp_path / "scores.parquet") == ROWS


def test_the_columns_have_the_names_that_others_rely_on(tmp_path: Path) -> None:
    write_scores([], tmp_path / "scores.parquet")
    names = parquet.read_schema(tmp_path / "scores.parquet").names
    assert names == "scene method seed camera frame_index metric value protocol".split()


def test_means_are_taken_over_frames_alone() -> None:
    means = mean_scores(ROWS)
    assert means["mocoflow"] == {"cam01": {"psnr": pytest.approx(25.0)}, "cam02": {"psnr": 15.0}}
    assert list(means) == ["mocoflow", "posed_mesh"]
