"""The tables of a benchmark: those of its runs, one below the other, with a column ``preset``.

``scores.parquet`` and ``error_curve.parquet`` keep the columns of a single run, so that whatever
reads a run's tables reads a benchmark's; ``preset`` comes last. ``scene`` is the benchmark's name
of the scene, and ``method`` tells ablations apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import pyarrow as pa
from pyarrow import parquet

from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.table import ScoreRow

Row = TypeVar("Row", ScoreRow, CurveRow)

# What a run calls its own method, whichever ablation it is.
RUN_METHOD = "mocoflow"


class Contender(NamedTuple):
    """What is compared: a method with a preset on a scene. Its runs differ in their seeds."""

    scene: str
    preset: str
    method: str


class Cell(NamedTuple):
    """One finished run of a benchmark, and the folder with its tables."""

    scene: str
    preset: str
    method: str
    seed: int
    folder: Path


# Rows by contender and seed.
Runs = dict[Contender, dict[int, list[Row]]]


def gather(
    cells: Sequence[Cell], methods: Sequence[str], read: Callable[[Path], list[Row]], name: str
) -> Runs[Row]:
    """The rows of the named methods from one table of every cell.

    A method that is scored within the runs of others, as the posed mesh is, comes from the first
    run of its scene, preset and seed.

    Args:
        cells: in the order of the benchmark; contenders keep it, methods that of ``methods``.
        read: of the table called ``name`` in a cell's folder.
    """
    runs: Runs[Row] = {}
    for cell in cells:
        for method, rows in _by_method(read(cell.folder / name)).items():
            called = cell.method if method == RUN_METHOD else method
            seeds = runs.setdefault(Contender(cell.scene, cell.preset, called), {})
            seeds.setdefault(cell.seed, [r._replace(scene=cell.scene, method=called) for r in rows])
    places = list(dict.fromkeys((cell.scene, cell.preset) for cell in cells))
    asked = [Contender(*place, method) for place in places for method in methods]
    return {contender: runs[contender] for contender in asked if contender in runs}


def write_runs(runs: Runs[Row], schema: pa.Schema, path: Path) -> None:
    """Write the rows of all runs as one Parquet table: ``schema`` and ``preset``."""
    records = [
        {**row._asdict(), "preset": contender.preset}
        for contender, seeds in runs.items()
        for rows in seeds.values()
        for row in rows
    ]
    complete = schema.append(pa.field("preset", pa.string()))
    parquet.write_table(pa.Table.from_pylist(records, schema=complete), path)


def read_runs(kind: Callable[..., Row], path: Path) -> Runs[Row]:
    """The runs of a table written by ``write_runs``; ``kind`` is its row."""
    runs: Runs[Row] = {}
    for record in parquet.read_table(path).to_pylist():
        preset = str(record.pop("preset"))
        row = kind(**record)
        seeds = runs.setdefault(Contender(row.scene, preset, row.method), {})
        seeds.setdefault(row.seed, []).append(row)
    return runs


def _by_method(rows: Iterable[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.method, []).append(row)
    return found
