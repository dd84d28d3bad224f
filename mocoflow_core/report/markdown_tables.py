"""The tables of a benchmark as Markdown, to be read beside code."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from mocoflow_core.methods.ablations import change_of
from mocoflow_core.methods.person_scores import PHOTOGRAPHS
from mocoflow_core.report.benchmark_results import BenchmarkResults
from mocoflow_core.report.history_words import in_words
from mocoflow_core.report.markdown_text import code, plain
from mocoflow_core.report.metric_labels import label_of
from mocoflow_core.report.misalignment_table import misalignment_tables
from mocoflow_core.report.summary_table import (
    ABOUT_PHOTOGRAPHS,
    SummaryCell,
    TableRow,
    by_scene,
    shown_metrics,
    summary_rows,
)


def write_markdown_tables(results: BenchmarkResults, command: str, path: Path) -> None:
    """Write a table for each scene, what its methods are, and what is missing.

    A row is a method; a cell is the mean over seeds, in brackets the lowest and the highest; the
    best of a scene is bold.
    """
    parts = (_head(results, command), _scores(results), _misplaced(results), _missing(results))
    path.write_text("\n".join(line for part in parts for line in part) + "\n", encoding="utf-8")


def _head(results: BenchmarkResults, command: str) -> Iterator[str]:
    yield f"# {results.experiment.title}"
    if results.experiment.about:
        yield from ("", results.experiment.about)
    yield from ("", code(command))


def _scores(results: BenchmarkResults) -> Iterator[str]:
    summaries = results.summaries()
    metrics = shown_metrics(summaries)
    several = len({contender.preset for contender in summaries}) > 1
    labels = [label_of(metric).with_title() for metric in metrics]
    for rows in by_scene(summary_rows(summaries, metrics)):
        yield from ("", f"## {plain(rows[0].contender.scene)}", "")
        yield from _table(["method", "seeds", *labels], (_cells(row, several) for row in rows))
    changes = {c.method: change_of(c.method) for c in summaries if change_of(c.method)}
    if summaries:
        yield ""
        yield "Mean over seeds, in brackets the lowest and the highest. Best of a scene in bold."
    if any(contender.method in PHOTOGRAPHS for contender in summaries):
        yield from ("", ABOUT_PHOTOGRAPHS)
    if changes:
        yield ""
        yield from (f"- {_words(method)}: {change}" for method, change in changes.items())


def _cells(row: TableRow, several_presets: bool) -> list[str]:
    name = _words(row.contender.method)
    if several_presets:
        name = f"{name}, {row.contender.preset}"
    return [name, str(row.seeds), *(_text(cell) for cell in row.cells)]


def _text(cell: SummaryCell) -> str:
    mean = f"**{cell.mean}**" if cell.best else cell.mean
    return f"{mean} ({cell.spread})" if cell.spread else mean


def _misplaced(results: BenchmarkResults) -> Iterator[str]:
    for table in misalignment_tables(results.misplaced):
        yield from ("", f"## {plain(table.scene)}, misplaced views", "")
        heading = ["", *(label.with_title() for label in table.labels)]
        yield from _table(heading, ([row.name, *row.values] for row in table.rows))
    for protocol in sorted({row.protocol for row in results.misplaced}):
        yield from ("", f"Protocol: {plain(protocol)}.")


def _missing(results: BenchmarkResults) -> Iterator[str]:
    worse = in_words(results.regressions())
    if worse:
        yield from ("", "## Worse than usual", "")
        yield from (f"- {plain(found.what)}: {plain(found.why)}" for found in worse)
    found = results.omissions()
    if found:
        yield from ("", "## Omissions", "")
        yield from (f"- {plain(omission.what)}: {plain(omission.why)}" for omission in found)


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield _line(heading)
    yield _line(["-", *("-:" for _ in heading[1:])])
    yield from (_line(row) for row in rows)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _words(name: str) -> str:
    return name.replace("_", " ")
