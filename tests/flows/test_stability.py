"""The flow stability and its command, on one area."""

from __future__ import annotations

import dataclasses
import errno
import os
import sys

import pytest

from flows.command_line import main
from mocoflow_core.errors import InputError
from mocoflow_core.report import stability_page
from mocoflow_core.stability import catalogue, compositing
from mocoflow_core.stability.table import read_table

AREA = "compositing"


@pytest.fixture
def run(prefect_server):
    from flows.stability import stability

    return stability


@pytest.fixture
def mocoflow(monkeypatch, prefect_server):
    """The exit code of the command in this process."""

    def command(*arguments):
        monkeypatch.setattr(sys, "argv", ["mocoflow", "stability", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code

    return command


@pytest.fixture
def planted(monkeypatch):
    """One case of the area with a bound that nothing can meet."""
    first, *others = compositing.CASES
    broken = dataclasses.replace(first, bound=-1.0)
    monkeypatch.setitem(catalogue.AREAS, AREA, (broken, *others))
    return broken


def test_a_run_leaves_table_plots_and_page(run, tmp_path):
    out = tmp_path / "out"
    summary = run(out=out, areas=(AREA,))
    rows = read_table(out / "stability.parquet")
    assert {row.area for row in rows} == {AREA}
    assert {row.case for row in rows} == {case.name for case in compositing.CASES}
    assert summary.cases == summary.passed == len(compositing.CASES)
    assert (out / "plots" / f"{AREA}.png").stat().st_size > 1000
    page = (out / "stability.html").read_text()
    for case in compositing.CASES:
        assert case.name.replace("_", " ") in page
    assert "<svg" in page
    assert 'src="' not in page  # nothing beside the file


def test_every_run_measures_afresh(run, tmp_path, planted):
    from flows.stability import CasesFailed

    with pytest.raises(CasesFailed, match="7 passed"):
        run(out=tmp_path / "out", areas=(AREA,))
    page = (tmp_path / "out" / "stability.html").read_text()
    assert f"{planted.name.replace('_', ' ')}</a> fails at 0" in page


def test_the_command_prints_one_summary_and_ends_with_0(mocoflow, tmp_path, capsys):
    assert mocoflow("--area", AREA, "--quick", "--out", tmp_path / "out") == 0
    first, second = capsys.readouterr().out.strip().splitlines()
    assert first.startswith("8 cases, 8 passed, worst margin ")
    assert second == f"Stability: {tmp_path / 'out' / 'stability.html'}"
    assert mocoflow("--area", AREA, "--out", tmp_path / "out") == 0  # over its own results


def test_the_command_ends_with_1_where_a_case_fails(mocoflow, tmp_path, capsys, planted):
    assert mocoflow("--area", AREA, "--out", tmp_path / "out") == 1
    assert "8 cases, 7 passed" in capsys.readouterr().out


def test_an_unknown_area_is_bad_input(mocoflow, tmp_path, capsys):
    assert mocoflow("--area", "se4", "--out", tmp_path / "out") == 2
    assert "se3" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("broken", ["write_table", "plot_sweeps", "render"])
def test_what_a_full_disk_broke_off_is_done_again_in_the_same_folder(
    mocoflow, tmp_path, capsys, monkeypatch, broken
):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    command = ("--area", AREA, "--out", tmp_path / "out")
    with monkeypatch.context() as patched:
        patched.setattr(stability_page, broken, full)
        assert mocoflow(*command) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert "full disk" in line
    assert mocoflow(*command) == 0


def test_several_areas_follow_one_option(mocoflow, tmp_path):
    assert mocoflow("--area", AREA, "encoding", "--quick", "--out", tmp_path / "out") == 0
    rows = read_table(tmp_path / "out" / "stability.parquet")
    assert {row.area for row in rows} == {AREA, "encoding"}


def test_a_folder_that_holds_something_else_is_refused(run, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="something else"):
        run(out=tmp_path, areas=(AREA,))
    assert [file.name for file in tmp_path.iterdir()] == ["letter.txt"]
