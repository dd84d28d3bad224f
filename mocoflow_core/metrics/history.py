"""One benchmark over many nights: what is worse or slower than it usually was."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
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


Number = tuple[Contender, str]  # of a contender, by its measure


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
    before: dict[Number, list[HistoryRow]] = {}
    for row in sorted(row for row in past if not math.isnan(row.value)):
        before.setdefault((row.contender, row.measure), []).append(row)
    here = {(row.contender, row.measure): row for row in now if not math.isnan(row.value)}
    found = [_worse(row, before.get(number, [])) for number, row in here.items()]
    return [*filter(None, found), *_missing(here, before)]


def _worse(row: HistoryRow, before: Sequence[HistoryRow]) -> Regression | None:
    """``before``: the same number in every night, the last one at the end."""
    values = [
        other.value
        for other in before
        if row.measure not in SECONDS or other.machine == row.machine
    ][-LAST_NIGHTS:]
    if len(values) < FEWEST_NIGHTS:
        return None
    usual = median(values)
    is_worse = as_error(row.measure, row.value) > as_error(row.measure, usual)
    if not is_worse or abs(row.value - usual) <= MARGINS[row.measure].at(usual):
        return None
    return Regression(row.contender, row.measure, row.value, usual, len(values))


def _missing(
    here: Container[Number], before: Mapping[Number, Sequence[HistoryRow]]
) -> Iterator[Regression]:
    """Numbers of the last nights that there are none of now."""
    nights = sorted({row.night for rows in before.values() for row in rows})
    last = set(nights[-LAST_NIGHTS:])
    for (contender, measure), rows in before.items():
        values = [row.value for row in rows if row.night in last]
        if measure in SECONDS or (contender, measure) in here or len(values) < FEWEST_NIGHTS:
            continue
        yield Regression(contender, measure, math.nan, median(values), len(values))


def write_history(rows: Iterable[HistoryRow], path: Path) -> None:
    """Write the rows as a Parquet table."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)
