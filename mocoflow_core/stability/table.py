"""The table of a stability run: one row for each value of each sweep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import parquet

SCHEMA = pa.schema(
    [
        ("area", pa.string()),
        ("case", pa.string()),
        ("parameter", pa.string()),
        ("value", pa.string()),
        ("number", pa.float64()),
        ("error", pa.float64()),
        ("bound", pa.float64()),
        ("unit", pa.string()),
        ("finite", pa.bool_()),
        ("passed", pa.bool_()),
        ("remark", pa.string()),
        ("seconds", pa.float64()),
    ]
)


class StabilityRow(NamedTuple):
    """One row of ``stability.parquet``."""

    area: str
    case: str
    parameter: str
    value: str
    number: float | None  # the value as a number; None where it is a word
    error: float  # nan where the case broke off
    bound: float
    unit: str
    finite: bool
    passed: bool
    remark: str
    seconds: float

    @property
    def margin(self) -> float:
        """How many times the error fits into the bound; infinite for an error of zero."""
        return self.bound / self.error if self.error > 0 else np.inf


class Summary(NamedTuple):
    """What is said about a whole run."""

    cases: int
    passed: int
    worst: StabilityRow | None  # the smallest margin among those that passed
    failed: list[StabilityRow]
    seconds: float

    def __str__(self) -> str:
        line = f"{self.cases} cases, {self.passed} passed"
        if self.worst is not None:
            at = f"{self.worst.area}/{self.worst.case} at {self.worst.value}"
            line += f", worst margin {self.worst.margin:.3g} ({at})"
        return f"{line}, {self.seconds:.0f} s"


def summarise(rows: Sequence[StabilityRow]) -> Summary:
    """A case passes when all values of its sweep do."""
    cases = {(row.area, row.case) for row in rows}
    failed = [row for row in rows if not row.passed]
    passing = [row for row in rows if row.passed and np.isfinite(row.margin)]
    return Summary(
        len(cases),
        len(cases) - len({(row.area, row.case) for row in failed}),
        min(passing, key=lambda row: row.margin, default=None),
        failed,
        sum(row.seconds for row in rows),
    )


def write_table(rows: Iterable[StabilityRow], path: Path) -> None:
    """Write the rows as a Parquet table, in their order."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)


def read_table(path: Path) -> list[StabilityRow]:
    """The rows of a table written by ``write_table``."""
    return [StabilityRow(**record) for record in parquet.read_table(path).to_pylist()]
