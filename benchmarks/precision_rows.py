"""What the work-precision study measures: a row for each run, a point for its seeds together."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from statistics import median
from typing import NamedTuple, get_type_hints


class Row(NamedTuple):
    """One run. CPU seconds of the training clock, preparation and optimisation apart."""

    scene: str
    knob: str
    value: str
    changes: str  # field=value, separated by blanks
    seed: int
    steps: int
    rays: int
    preparation_s: float
    optimisation_s: float
    psnr_union: float
    mask_iou: float


class Point(NamedTuple):
    """The seeds of one setting on one scene: their medians, and the range of the error."""

    scene: str
    knob: str
    value: str
    seeds: int
    steps: int
    rays: int
    preparation_s: float
    optimisation_s: float
    psnr_union: float
    lowest_psnr: float
    highest_psnr: float
    mask_iou: float

    @property
    def cpu_s(self) -> float:
        """Of the whole training clock."""
        return self.preparation_s + self.optimisation_s


def write_rows(rows: Iterable[Row], path: Path) -> None:
    """Write the rows as comma-separated values with a header."""
    with path.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(Row._fields)
        for row in rows:
            table.writerow(f"{v:.4f}" if isinstance(v, float) else v for v in row)


def read_rows(path: Path) -> list[Row]:
    """The rows of a table written by ``write_rows``."""
    kinds = get_type_hints(Row)
    with path.open(newline="") as file:
        return [
            Row(*(kinds[name](record[name]) for name in Row._fields))
            for record in csv.DictReader(file)
        ]


def points_of(rows: Iterable[Row], seeds: range | None = None) -> list[Point]:
    """One point for each setting and scene, in order of appearance.

    Args:
        seeds: only these, so that settings measured with more seeds compare with the others.
    """
    runs: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        if seeds is None or row.seed in seeds:
            runs.setdefault((row.scene, row.knob, row.value), []).append(row)
    return [_point(found) for found in runs.values()]


def _point(rows: list[Row]) -> Point:
    first = rows[0]
    errors = [row.psnr_union for row in rows]
    return Point(
        first.scene,
        first.knob,
        first.value,
        len(rows),
        round(median(row.steps for row in rows)),
        round(median(row.rays for row in rows)),
        median(row.preparation_s for row in rows),
        median(row.optimisation_s for row in rows),
        median(errors),
        min(errors),
        max(errors),
        median(row.mask_iou for row in rows),
    )
