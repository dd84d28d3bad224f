"""What counts as a failure, and what is said about a whole run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from mocoflow_core.errors import InputError
from mocoflow_core.stability.case import Case, Found, require
from mocoflow_core.stability.measurement import measure_case, measure_cases
from mocoflow_core.stability.table import read_table, summarise, write_table

SOUND = Case(
    "halves", "nothing", "x", (0.5, 1.0), "x / 2", lambda x: Found(x / 2), 0.6, "m", "because"
)


def measured(measure, bound=1.0):
    (row,) = measure_case(
        "area", dataclasses.replace(SOUND, values=(2.0,), measure=measure, bound=bound)
    )
    return row


def test_an_error_within_its_bound_passes_and_one_above_fails():
    assert measured(lambda x: Found(1.0)).passed
    assert not measured(lambda x: Found(1.0 + 1e-12)).passed


def test_a_bound_may_depend_on_the_value():
    assert measured(lambda x: Found(3.9), bound=lambda x: 2 * x).passed
    assert not measured(lambda x: Found(4.1), bound=lambda x: 2 * x).passed


@pytest.mark.parametrize("planted", [np.nan, np.inf])
def test_a_watched_number_that_is_not_finite_fails_however_small_the_error(planted):
    for watched in (torch.tensor([1.0, planted]), np.array([planted]), planted):
        row = measured(lambda x, watched=watched: Found(0.0, (watched,)))
        assert not row.passed
        assert not row.finite


@pytest.mark.parametrize("error", [np.nan, np.float64(0.5), np.float64(2.0)])
def test_a_verdict_is_plain_whatever_kind_of_number_the_error_is(error):
    row = measured(lambda x: Found(error))
    assert type(row.passed) is type(row.finite) is bool


def test_whatever_is_raised_is_a_failure_with_its_words():
    def refused(x):
        raise InputError("a b", "c", "Do d.")

    assert measured(refused).remark == "InputError: a b, got c. Do d."
    broken = measured(lambda x: require(False, "in silence"))
    assert not broken.passed
    assert "in silence" in broken.remark


def test_every_value_starts_from_the_same_random_state():
    drawn = []
    case = dataclasses.replace(SOUND, measure=lambda x: drawn.append(torch.rand(())) or Found(0.0))
    torch.manual_seed(5)
    before = torch.get_rng_state()
    list(measure_case("area", case))
    assert drawn[0] == drawn[1]
    assert torch.equal(torch.get_rng_state(), before)


def test_one_failing_value_fails_its_case_and_no_other():
    failing = dataclasses.replace(SOUND, name="fails", bound=0.4)
    summary = summarise(measure_cases("area", (SOUND, failing)))
    assert (summary.cases, summary.passed) == (2, 1)
    assert [row.value for row in summary.failed] == ["1"]
    assert str(summary).startswith("2 cases, 1 passed, worst margin 1.2 (area/halves at 1)")


def test_the_table_survives_its_file(tmp_path):
    words = dataclasses.replace(SOUND, name="words", values=("a",), measure=lambda x: Found(0.0))
    rows = measure_cases("area", (SOUND, words))
    write_table(rows, tmp_path / "stability.parquet")
    assert read_table(tmp_path / "stability.parquet") == rows
    assert [row.number for row in rows] == [0.5, 1.0, None]
