"""The table of scores: one row per number, each with the protocol it was measured under."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import parquet

SCHEMA = pa.schema(
    [
        ("scene", pa.string()),
        ("method", pa.string()),
        ("seed", pa.int64()),
        ("camera", pa.string()),
        ("frame_index", pa.int64()),
        ("metric", pa.string()),
        ("value", pa.float64()),
        ("protocol", pa.string()),
    ]
)


class ScoreRow(NamedTuple):
    """One number of ``scores.parquet``."""

    scene: str
    method: str
    seed: int
    camera: str
    frame_index: int
    metric: str
    value: float
    protocol: str


def write_scores(rows: Sequence[ScoreRow], path: Path) -> None:
    """Write the rows as a Parquet table, in their order."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)


def read_scores(path: Path) -> list[ScoreRow]:
    """The rows of a table written by ``write_scores``; a benchmark's further column is left out."""
    records = parquet.read_table(path, columns=SCHEMA.names).to_pylist()
    return [ScoreRow(**record) for record in records]


def mean_scores(rows: Iterable[ScoreRow]) -> dict[str, dict[str, dict[str, float]]]:
    """Mean over frames as ``{method: {camera: {metric: value}}}``, in order of appearance."""
    values: dict[str, dict[str, dict[str, list[float]]]] = {}
    for row in rows:
        metrics = values.setdefault(row.method, {}).setdefault(row.camera, {})
        metrics.setdefault(row.metric, []).append(row.value)
    return {
        method: {
            camera: {metric: float(np.mean(numbers)) for metric, numbers in metrics.items()}
            for camera, metrics in cameras.items()
        }
        for method, cameras in values.items()
    }
