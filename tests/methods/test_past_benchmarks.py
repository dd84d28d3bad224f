"""The nights before, as the folders around a benchmark's tell them."""

from __future__ import annotations

from pathlib import Path

import pytest

from mocoflow_core.methods.benchmark_folder import BenchmarkFolder, BenchmarkRecord, CellRecord
from mocoflow_core.methods.past_benchmarks import night_rows, past_nights, read_nights
from mocoflow_core.metrics.history import NOW

MEAN = {"scene": "turn", "preset": "fast", "method": "mocoflow", "metric": "psnr", "mean": 20.0}


def begun(question: str = "--scenes turn") -> BenchmarkRecord:
    return BenchmarkRecord(settings=(), budget_s=None, command="", question=question)


def cell(seed: int, **changes) -> CellRecord:
    known = {"scene": "turn", "preset": "fast", "method": "mocoflow", "folder": ""}
    spent = {"wall_s": 40.0 + seed, "cpu_s": 30.0 + seed, "machine": {"model": "one", "load": 9.0}}
    return CellRecord(**known, seed=seed, state="finished", **spent | changes)


@pytest.fixture
def finish(tmp_path):
    """Finishes a benchmark in a folder; its moment is given, as a clock would."""

    def finish(name: str, moment: str, question: str = "--scenes turn") -> BenchmarkFolder:
        folder = BenchmarkFolder.claim(tmp_path / name, begun(question))
        record = folder.finish({"summary": (MEAN,), "cells": (cell(0), cell(1))})
        written = record.model_copy(update={"finished_at": moment})
        (folder.path / "benchmark.json").write_text(written.model_dump_json())
        return folder

    return finish


def test_a_night_has_its_means_and_the_median_seconds_of_a_seed():
    rows = night_rows(NOW, [cell(0), cell(1), cell(2)], [MEAN])
    assert {row.measure: row.value for row in rows} == {"psnr": 20.0, "wall_s": 41.0, "cpu_s": 31.0}
    assert {row.machine for row in rows if row.measure == "cpu_s"} == {"model one"}


def test_what_was_trained_before_says_nothing_of_a_nights_speed():
    rows = night_rows(NOW, [cell(0, from_store=True)], [MEAN])
    assert [row.measure for row in rows] == ["psnr"]
    rows = night_rows(NOW, [cell(0, from_store=True), cell(4)], [MEAN])
    assert {row.value for row in rows if row.measure == "cpu_s"} == {34.0}


def test_finished_ones_that_asked_the_same_are_the_past(finish, tmp_path):
    finish("second", "2026-01-02T01:00:00+00:00")
    finish("first", "2026-01-01T01:00:00+00:00")
    finish("other", "2026-01-03T01:00:00+00:00", question="--scenes walk")
    BenchmarkFolder.claim(tmp_path / "unfinished", begun())
    (tmp_path / "unreadable").mkdir()
    (tmp_path / "unreadable/benchmark.json").write_text("{")
    nights = past_nights(tmp_path / "now", begun())
    assert nights == ["first", "second"]
    rows = read_nights(tmp_path, nights)
    assert sorted({row.night[:10] for row in rows}) == ["2026-01-01", "2026-01-02"]
    assert {row.value for row in rows if row.measure == "psnr"} == {20.0}


def test_a_benchmark_that_is_asked_for_again_keeps_its_place_among_the_nights(finish, tmp_path):
    finish("first", "2026-01-01T01:00:00+00:00")
    finish("second", "2026-01-02T01:00:00+00:00")
    finish("third", "2026-01-03T01:00:00+00:00")
    again = BenchmarkFolder.claim(tmp_path / "second", begun())
    again = BenchmarkFolder.claim(tmp_path / "second", begun())  # The command line, then the flow.
    assert past_nights(again.path, again.begun) == ["first"]
    assert again.finish({}).finished_at == "2026-01-02T01:00:00+00:00"


def test_one_of_which_nothing_finished_is_no_night_and_its_retry_is_one_of_its_own(
    finish, tmp_path
):
    empty = BenchmarkFolder.claim(tmp_path / "now", begun())
    assert empty.finish({}).finished_at == ""
    finish("meanwhile", "2026-01-01T01:00:00+00:00")
    again = BenchmarkFolder.claim(tmp_path / "now", begun())
    assert past_nights(again.path, again.begun)
    assert again.finish({"cells": (cell(0),)}).finished_at > "2026-01-01"


def test_the_folder_may_be_the_working_directory(finish, tmp_path, monkeypatch):
    finish("first", "2026-01-01T01:00:00+00:00")
    (tmp_path / "now").mkdir()
    monkeypatch.chdir(tmp_path / "now")
    assert past_nights(Path(), begun())


def test_records_that_do_not_know_what_was_asked_are_no_past(finish, tmp_path):
    finish("old", "2026-01-01T01:00:00+00:00", question="")
    assert not past_nights(tmp_path / "now", begun(question=""))
