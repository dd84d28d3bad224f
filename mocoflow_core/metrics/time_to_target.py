"""Time to target: when a method was first as good as asked, as the median over seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.metrics.benchmark_tables import Runs
from mocoflow_core.metrics.curve import CURVE_METRICS, NETWORK_METRICS, CurveRow, seconds_to_target

SCHEMA = pa.schema(
    [
        ("scene", pa.string()),
        ("preset", pa.string()),
        ("method", pa.string()),
        ("metric", pa.string()),
        ("target", pa.float64()),
        ("seeds", pa.int64()),
        ("reached", pa.int64()),
        ("median_wall_s", pa.float64()),
        ("median_cpu_s", pa.float64()),
    ]
)


class Target(NamedTuple):
    """A score that is worth a wait."""

    metric: str
    value: float


class TimeToTarget(NamedTuple):
    """One row of ``time_to_target.parquet``; seconds of the training clock."""

    scene: str
    preset: str
    method: str
    metric: str
    target: float
    seeds: int
    reached: int  # by so many of them
    median_wall_s: float | None  # none where the median seed did not reach it
    median_cpu_s: float | None


class TargetConfig(ConfigurationPart):
    """What is waited for."""

    targets: tuple[Target, ...] = (
        *(Target("psnr_union", value) for value in (12.0, 14.0, 16.0, 18.0, 20.0, 22.0)),
        *(Target("psnr", value) for value in (16.0, 18.0, 20.0, 22.0, 24.0, 26.0)),
    )


def read_target(text: str) -> Target:
    """``psnr_union=20`` as a target.

    Raises InputError for a metric that no curve has, and for a value that is no finite number.
    """
    name, _, written = text.partition("=")
    metric = name.strip()
    if metric not in CURVE_METRICS:
        raise InputError(
            f"A target's metric must be one of {', '.join(CURVE_METRICS)}",
            repr(text),
            "Write psnr_union=20.",
        )
    try:
        value = float(written)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            "A target is a metric and a finite number", repr(text), "Write psnr_union=20."
        )
    return Target(metric, value)


def require_measured(waited_for: TargetConfig, networks_on_curve: bool) -> None:
    """Raise InputError for a target that networks would have to measure and do not."""
    for target in waited_for.targets:
        if target.metric in NETWORK_METRICS and not networks_on_curve:
            raise InputError(
                f"person_scores.on_curve and networks that are on, to wait for {target.metric}",
                "a curve without it",
                "Add --set person_scores.on_curve=true --set person_scores.use=on.",
            )


def times_to_targets(runs: Runs[CurveRow], targets: Sequence[Target]) -> list[TimeToTarget]:
    """Each contender's time to each target, for the metrics that its scene is scored by.

    The time is that of the first measurement which is good enough, never one between two. A seed
    that did not reach the target counts as infinitely late.
    """
    found = []
    for contender, seeds in runs.items():
        scored = {row.metric for rows in seeds.values() for row in rows}
        for target in targets:
            if target.metric in scored:
                wall, cpu = (
                    [seconds_to_target(rows, *target, clock) for rows in seeds.values()]
                    for clock in ("wall_s", "cpu_s")
                )
                reached = len(wall) - wall.count(None)
                medians = (_median(wall), _median(cpu))
                found.append(TimeToTarget(*contender, *target, len(wall), reached, *medians))
    return found


def _median(seconds: Sequence[float | None]) -> float | None:
    """Of which None is later than any number."""
    median = float(np.median([np.inf if second is None else second for second in seconds]))
    return median if np.isfinite(median) else None


def write_times(rows: Sequence[TimeToTarget], path: Path) -> None:
    """Write the rows as a Parquet table, in their order."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)


def read_times(path: Path) -> list[TimeToTarget]:
    """The rows of a table written by ``write_times``."""
    return [TimeToTarget(**record) for record in parquet.read_table(path).to_pylist()]
