"""One benchmark over many nights: what is worse or slower than it usually was."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

import pyarrow as pa
from pyarrow import parquet

from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.curve import as_error

# What is usual: the median of so many nights; with fewer than the least nothing is.
LAST_NIGHTS = 10
FEWEST_NIGHTS = 3

SECONDS = ("cpu_s", "wall_s")
# This night, which is not finished while it is compared.
NOW = ""

SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ("night", "machine", "scene", "preset", "method")),
        ("measure", pa.string()),
        ("value", pa.float64()),
    ]
)


class HistoryRow(NamedTuple):
    """One number of one contender in one night: a mean over seeds, or median seconds of a seed."""

    night: str  # when it was finished: UTC, ISO 8601, whose texts sort as their moments
    machine: str
    scene: str
    preset: str
    method: str
    measure: str
    value: float

    @property
    def contender(self) -> Contender:
        return Contender(self.scene, self.preset, self.method)


class Margin(NamedTuple):
    """How much worse than usual is no news: the larger of both."""

    absolute: float  # in the unit of the measure
    relative: float = 0.0  # part of the usual value

    def at(self, usual: float) -> float:
        return max(self.absolute, self.relative * abs(usual))


# Wall seconds have the machine's other work in them.
MARGINS = {
    "psnr_union": Margin(0.3),
    "psnr": Margin(0.3),
    "ssim": Margin(0.01),
    "lpips_alex": Margin(0.01),
    "mask_iou": Margin(0.01),
    "plausibility": Margin(0.05),
    "oks": Margin(0.02),
    "keypoint_mm": Margin(1.0, 0.1),
    "surface_mm": Margin(1.0, 0.1),
    "correspondence_mm": Margin(1.0, 0.1),
    "cpu_s": Margin(1.0, 0.2),
    "wall_s": Margin(2.0, 0.5),
}


class Regression(NamedTuple):
    """A number that is worse than usual by more than its margin; nan where there is none now."""

    contender: Contender
    measure: str
    value: float
    usual: float
    nights: int  # that the usual value is the median of


def regressions(now: Iterable[HistoryRow], past: Iterable[HistoryRow]) -> list[Regression]:
    """What is worse, slower or missing, against the median of the last nights.

    Seconds are compared with nights on the same machine alone, and are never missing: what an
    earlier command has trained has none.
    """
    past = [row for row in past if not math.isnan(row.value)]
    now = [row for row in now if not math.isnan(row.value)]
    found = [worse for row in now if (worse := _worse(row, _before(row, past)))]
    return found + _missing(now, past)


def _before(row: HistoryRow, past: Iterable[HistoryRow]) -> list[float]:
    """The same number in the last nights."""
    same = [
        other
        for other in past
        if (other.contender, other.measure) == (row.contender, row.measure)
        and (row.measure not in SECONDS or other.machine == row.machine)
    ]
    return [other.value for other in sorted(same)[-LAST_NIGHTS:]]


def _worse(row: HistoryRow, before: Sequence[float]) -> Regression | None:
    if len(before) < FEWEST_NIGHTS:
        return None
    usual = median(before)
    is_worse = as_error(row.measure, row.value) > as_error(row.measure, usual)
    if not is_worse or abs(row.value - usual) <= MARGINS[row.measure].at(usual):
        return None
    return Regression(row.contender, row.measure, row.value, usual, len(before))


def _missing(now: Iterable[HistoryRow], past: Sequence[HistoryRow]) -> list[Regression]:
    """Numbers of the last nights that there are none of now."""
    here = {(row.contender, row.measure) for row in now}
    last = set(sorted({row.night for row in past})[-LAST_NIGHTS:])
    gone: dict[tuple[Contender, str], list[float]] = {}
    for row in past:
        number = (row.contender, row.measure)
        if row.night in last and row.measure not in SECONDS and number not in here:
            gone.setdefault(number, []).append(row.value)
    return [
        Regression(*number, math.nan, median(values), len(values))
        for number, values in gone.items()
        if len(values) >= FEWEST_NIGHTS
    ]


def write_history(rows: Iterable[HistoryRow], path: Path) -> None:
    """Write the rows as a Parquet table."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)
