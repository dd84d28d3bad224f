from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.report.stability_page import write_stability
from mocoflow_core.report.stability_plot import plot_sweeps
from mocoflow_core.stability.table import StabilityRow

MACHINE = {"model": "abacus", "system": "wood", "python": "3", "cores": 1, "load": 0.0}


def row(value="1", error=0.5, **changes) -> StabilityRow:
    known = StabilityRow(
        area="se3",
        case="exponential",
        parameter="angle, rad",
        value=value,
        number=float(value) if value.replace(".", "").isdecimal() else None,
        error=error,
        bound=1.0,
        unit="m",
        finite=bool(np.isfinite(error)),
        passed=bool(error <= 1.0),
        remark="",
        seconds=0.1,
    )
    return known._replace(**changes)


def page_of(rows, folder) -> str:
    write_stability(rows, MACHINE, folder)
    return (folder / "stability.html").read_text()


def test_a_case_shows_the_value_that_came_nearest_to_its_bound(tmp_path):
    page = page_of([row("1", 0.5), row("2", 0.8), row("3", 0.1)], tmp_path)
    assert "at 2<" in page
    assert "1.25 ×" in page


def test_a_failure_is_shown_instead_of_a_smaller_margin_that_passed(tmp_path):
    page = page_of([row("1", 0.999), row("2", np.nan, remark="LawBroken: in silence")], tmp_path)
    assert "at 2<" in page
    assert "fails at 2" in page
    assert "LawBroken: in silence" in page


def test_words_of_a_remark_are_text_and_not_markup(tmp_path):
    assert "<script>" not in page_of([row(remark="<script>alert(1)</script>")], tmp_path)


@pytest.mark.parametrize(
    "values",
    [("1", "2"), ("0", "0.001", "1000"), ("black", "white"), ("1", "2", "3", "4", "5", "6", "7")],
)
def test_sweeps_of_numbers_and_of_words_are_drawn(values):
    rows = [row(value, error) for value, error in zip(values, [0.0, 0.5] * 4, strict=False)]
    figure = plot_sweeps([*rows, row("9", np.inf)])
    axes = figure.axes[0]
    drawn = np.concatenate([line.get_ydata() for line in axes.lines])
    # The bound, a mark for each value, and a line between errors where there is a between.
    assert len(axes.lines) == 1 + len(values) + 1 + (rows[0].number is not None)
    assert (drawn[np.isfinite(drawn)] > 0).all()


def test_a_single_value_is_no_sweep():
    assert plot_sweeps([row()]) is None


def test_a_full_disk_is_bad_input_and_leaves_nothing_half_written(tmp_path):
    (tmp_path / ".new.stability.parquet").symlink_to("/dev/full")
    with pytest.raises(InputError, match="full disk"):
        write_stability([row()], MACHINE, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_page_that_cannot_be_written_leaves_the_table_and_no_earlier_page(tmp_path):
    write_stability([row()], MACHINE, tmp_path)
    (tmp_path / ".new.stability.html").symlink_to("/dev/full")
    with pytest.raises(InputError, match="full disk"):
        write_stability([row()], MACHINE, tmp_path)
    assert [path.name for path in tmp_path.rglob("stability*")] == ["stability.parquet"]
