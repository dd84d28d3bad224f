"""Stage collect_cells: the tables of many runs in one, and what they take to reach a target."""

from __future__ import annotations

from typing import Any

from pydantic import JsonValue

from mocoflow_core.artifacts import CellTablesArtifact
from mocoflow_core.methods.benchmark_folder import finished_cells
from mocoflow_core.methods.person_scores import PHOTOGRAPHS
from mocoflow_core.metrics import curve, table
from mocoflow_core.metrics.benchmark_tables import gather, write_runs
from mocoflow_core.metrics.misalignment import MisalignmentRow, write_misalignment
from mocoflow_core.metrics.time_to_target import TargetConfig, times_to_targets, write_times
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 3  # The photographs' own scores.


@stage(CellTablesArtifact, ALGORITHM_VERSION)
def collect_cells(
    work: Stage,
    folder: Source,
    cells: list[dict[str, JsonValue]],
    methods: list[str],
    targets: TargetConfig,
    misplaced: list[dict[str, Any]],
) -> Summary:
    """Scores and error curves of the cells that finished; rows of views that were misplaced.

    Output: ``scores.parquet``, ``error_curve.parquet``, ``time_to_target.parquet``,
    ``misalignment.parquet``. Seconds.
    """
    finished = finished_cells(cells, folder.path)
    scores = gather(finished, [*methods, *PHOTOGRAPHS], table.read_scores, "scores.parquet")
    curves = gather(finished, methods, curve.read_curve, "error_curve.parquet")
    write_runs(scores, table.SCHEMA, work.folder / "scores.parquet")
    write_runs(curves, curve.SCHEMA, work.folder / "error_curve.parquet")
    times = times_to_targets(curves, targets.targets)
    write_times(times, work.folder / "time_to_target.parquet")
    rows = [MisalignmentRow(**row) for row in misplaced]
    write_misalignment(rows, work.folder / "misalignment.parquet")
    return {"contenders": len(scores)}
