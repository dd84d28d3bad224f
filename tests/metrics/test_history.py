"""What is worse than it usually was."""

from __future__ import annotations

import math

import pytest

from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.history import (
    FEWEST_NIGHTS,
    LAST_NIGHTS,
    MARGINS,
    NOW,
    HistoryRow,
    regressions,
)
from mocoflow_core.report.seed_summary import METRICS

OURS = Contender("turn", "fast", "mocoflow")


def row(night: str, measure: str, value: float, machine: str = "", who: Contender = OURS):
    return HistoryRow(night, machine, *who, measure, value)


def nights(measure: str, *values: float, machine: str = "") -> list[HistoryRow]:
    return [row(f"2026-01-{n + 1:02}", measure, v, machine) for n, v in enumerate(values)]


def flagged(measure: str, value: float, past: list[HistoryRow], machine: str = "") -> bool:
    return bool(regressions([row(NOW, measure, value, machine)], past))


@pytest.mark.parametrize("measure", MARGINS)
def test_worse_by_more_than_its_margin_is_flagged_and_better_never(measure):
    usual = 0.5
    past, margin = nights(measure, usual, usual, usual), MARGINS[measure].at(usual)
    worse = -1.0 if regressions([row(NOW, measure, usual - 1.1 * margin)], past) else 1.0
    assert flagged(measure, usual + worse * 1.01 * margin, past)
    assert not flagged(measure, usual + worse * 0.99 * margin, past)
    assert not flagged(measure, usual - worse * 100 * margin, past)


def test_a_lower_psnr_and_more_seconds_are_worse():
    assert flagged("psnr_union", 20.0, nights("psnr_union", 21.0, 21.0, 21.0))
    assert flagged("cpu_s", 40.0, nights("cpu_s", 30.0, 30.0, 30.0))


def test_every_number_of_a_benchmark_has_a_margin():
    assert set(METRICS) <= set(MARGINS)


def test_with_too_few_nights_nothing_is_usual():
    past = nights("psnr_union", *[21.0] * (FEWEST_NIGHTS - 1))
    assert not flagged("psnr_union", 5.0, past)


def test_usual_is_the_median_of_the_last_nights_whatever_their_order():
    old, new = [30.0] * 20, [20.0] * (LAST_NIGHTS - 1) + [90.0]
    past = nights("psnr_union", *old, *new)
    assert not flagged("psnr_union", 19.9, past[::-1])
    [found] = regressions([row(NOW, "psnr_union", 19.0)], past[::-1])
    assert (found.usual, found.nights) == (20.0, LAST_NIGHTS)


def test_seconds_of_another_machine_are_no_measure():
    past = nights("cpu_s", 10.0, 10.0, 10.0, machine="a fast one")
    assert not flagged("cpu_s", 99.0, past, machine="a slow one")
    assert flagged("cpu_s", 99.0, past, machine="a fast one")


@pytest.mark.parametrize(
    "now", [[], [row(NOW, "oks", math.nan)], [row(NOW, "ssim", 0.9)]], ids=["none", "nan", "other"]
)
def test_a_score_that_there_is_none_of_now_is_flagged(now):
    [found] = regressions(now, nights("oks", 0.9, 0.9, 0.8))
    assert (found.contender, found.measure, found.usual, found.nights) == (OURS, "oks", 0.9, 3)
    assert math.isnan(found.value)


def test_seconds_that_nobody_measured_now_are_not_missing():
    assert not regressions([row(NOW, "ssim", 0.9)], nights("cpu_s", 30.0, 30.0, 30.0))


def test_one_that_went_long_ago_is_no_news():
    gone = nights("psnr_union", 21.0, 21.0, 21.0)
    other = Contender("walk", "fast", "mocoflow")
    since = [row(f"2026-02-{n + 1:02}", "psnr_union", 21.0, who=other) for n in range(LAST_NIGHTS)]
    assert not regressions([row(NOW, "psnr_union", 21.0, who=other)], [*gone, *since])


def test_nights_without_a_number_do_not_count():
    past = nights("keypoint_mm", 20.0, math.nan, math.nan, 20.0)
    assert not flagged("keypoint_mm", 90.0, past)
    assert flagged("keypoint_mm", 90.0, [*past, *nights("keypoint_mm", 20.0)])
