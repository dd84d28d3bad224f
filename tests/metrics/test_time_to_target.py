from __future__ import annotations

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.time_to_target import (
    Target,
    TargetConfig,
    read_target,
    read_times,
    times_to_targets,
    write_times,
)

MOCOFLOW = Contender("turn", "fast", "mocoflow")


def reaching(seconds: float | None) -> list[CurveRow]:
    """A run that is at 15 dB from its first second and at 20 dB from ``seconds`` on."""
    times = [(1.0, 15.0)] + ([] if seconds is None else [(seconds, 20.0), (seconds + 9, 21.0)])
    return [
        CurveRow("turn", "mocoflow", 0, "optimise_scene", 1, t, 2 * t, "psnr", value)
        for t, value in times
    ]


def row(*seconds: float | None, target: float = 20.0):
    runs = {MOCOFLOW: {seed: reaching(s) for seed, s in enumerate(seconds)}}
    [found] = times_to_targets(runs, [Target("psnr", target)])
    return found


def test_the_time_is_the_median_over_seeds():
    assert row(4.0, 30.0, 7.0).median_wall_s == 7.0
    assert row(4.0, 7.0).median_wall_s == 5.5
    assert row(7.0).median_wall_s == 7.0


def test_a_seed_that_never_gets_there_is_later_than_all_others():
    found = row(4.0, None, 7.0)
    assert (found.median_wall_s, found.reached, found.seeds) == (7.0, 2, 3)


def test_where_the_median_wall_seed_does_not_get_there_is_no_time():
    assert row(4.0, None, None).median_wall_s is None
    assert row(4.0, None).median_wall_s is None
    assert row(None).reached == 0


def test_a_harder_target_is_never_reached_sooner():
    times = [row(4.0, 6.0, 9.0, target=value).median_wall_s for value in (10, 15, 18, 20, 21)]
    assert times == sorted(times)
    assert times[0] == 1.0


def test_only_metrics_that_were_measured_are_waited_for():
    runs = {MOCOFLOW: {0: reaching(4.0)}}
    assert {found.metric for found in times_to_targets(runs, TargetConfig().targets)} == {"psnr"}


def test_a_table_comes_back_as_it_was_written(tmp_path):
    rows = [row(4.0), row(None)]
    write_times(rows, tmp_path / "time_to_target.parquet")
    assert read_times(tmp_path / "time_to_target.parquet") == rows


def test_a_written_target_is_a_metric_and_a_number():
    assert read_target("psnr_union=20") == Target("psnr_union", 20.0)
    for wrong in ("psnr_union", "20", "psnr=good"):
        with pytest.raises(InputError, match="psnr_union=20"):
            read_target(wrong)


def test_a_target_that_no_run_could_reach_is_refused():
    for unknown in ("foo=3", "keypoint_mm=30"):  # The second is measured, but not along the curve.
        with pytest.raises(InputError, match="must be one of psnr_union, psnr,"):
            read_target(unknown)
    for endless in ("psnr=nan", "psnr=inf", "psnr=-inf"):
        with pytest.raises(InputError, match="finite number"):
            read_target(endless)


def test_cpu_seconds_are_those_of_the_same_measurement():
    assert row(4.0, 7.0, 9.0).median_cpu_s == 14.0
    assert row(4.0, None, None).median_cpu_s is None
