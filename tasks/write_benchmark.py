"""Stage write_benchmark: chart and page of a benchmark."""

from __future__ import annotations

from pydantic import JsonValue

from mocoflow_core.artifacts import BenchmarkArtifact, CellTablesArtifact
from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.methods.experiments import EXPERIMENTS, USUAL
from mocoflow_core.methods.past_benchmarks import read_nights
from mocoflow_core.metrics.benchmark_tables import read_runs
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.history import write_history
from mocoflow_core.metrics.misalignment import read_misalignment
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import read_times
from mocoflow_core.report.benchmark_chart import write_benchmark_chart
from mocoflow_core.report.benchmark_page import write_benchmark_page
from mocoflow_core.report.benchmark_results import BenchmarkResults
from mocoflow_core.report.history_words import in_words
from mocoflow_core.report.markdown_tables import write_markdown_tables
from mocoflow_core.report.omissions import Omission
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 5  # The nights before.


@stage(BenchmarkArtifact, ALGORITHM_VERSION)
def write_benchmark(
    work: Stage,
    tables: CellTablesArtifact,
    cells: list[dict[str, JsonValue]],
    command: str,
    experiment: str | None,
    unread: list[dict[str, str]],
    nights: list[str],
    past: Source,
) -> Summary:
    """Error against run time with median and range, scores, time to target, omissions, machine.

    And how this night compares with those before: folders of ``nights`` in ``past``. ``unread``
    are omissions that no cell tells of.

    Output: ``benchmark.html``, ``table.md``, ``history.parquet``, and ``error_against_time.png``
    where a cell finished. Seconds.
    """
    held = work.open(tables)
    results = BenchmarkResults(
        cells=[CellRecord.model_validate(cell) for cell in cells],
        scores=read_runs(ScoreRow, held / "scores.parquet"),
        curves=read_runs(CurveRow, held / "error_curve.parquet"),
        times=read_times(held / "time_to_target.parquet"),
        misplaced=read_misalignment(held / "misalignment.parquet"),
        experiment=USUAL if experiment is None else EXPERIMENTS[experiment],
        unread=[Omission(**omission) for omission in unread],
        past=read_nights(past.path, nights),
    )
    write_benchmark_chart(results.curves, work.folder / "error_against_time.png")
    write_benchmark_page(results, command, work.folder / "benchmark.html")
    write_markdown_tables(results, command, work.folder / "table.md")
    write_history([*results.past, *results.tonight()], work.folder / "history.parquet")
    return {
        "summary": results.summary_records(),
        "omissions": [omission._asdict() for omission in results.omissions()],
        "regressions": [worse._asdict() for worse in in_words(results.regressions())],
    }
