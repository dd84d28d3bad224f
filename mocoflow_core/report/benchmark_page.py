"""The page of a benchmark: one HTML file that needs nothing beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from mocoflow_core.methods.ablations import ABLATIONS
from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.metrics.benchmark_tables import Contender, Runs
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import TimeToTarget
from mocoflow_core.report.benchmark_chart import plot_benchmark
from mocoflow_core.report.curve_plot import svg_of
from mocoflow_core.report.metric_labels import label_of
from mocoflow_core.report.omissions import Omission, omissions
from mocoflow_core.report.seed_summary import METRICS, Summaries, summarise
from mocoflow_core.report.template import render, seconds_text

# Of a machine's description; the load differs from cell to cell.
MACHINE = ("model", "cores", "threads", "system", "python")


@dataclass(frozen=True)
class BenchmarkResults:
    """All that a benchmark's tables hold."""

    cells: Sequence[CellRecord]
    scores: Runs[ScoreRow]
    curves: Runs[CurveRow]
    times: Sequence[TimeToTarget]

    def summaries(self) -> Summaries:
        """Mean and range over seeds by contender and metric."""
        cameras = {cell.scene: cell.train_camera for cell in self.cells if cell.train_camera}
        return summarise(self.scores, cameras)

    def omissions(self) -> list[Omission]:
        """What is missing, or compares nothing."""
        return omissions(self.cells, self.scores, self.times)

    def summary_records(self) -> list[dict[str, Any]]:
        """The summaries as plain values, for ``benchmark.json``."""
        return [
            {**contender._asdict(), "metric": metric, **summary._asdict()}
            for contender, summaries in self.summaries().items()
            for metric, summary in summaries.items()
        ]


class SummaryCell(NamedTuple):
    """Mean over seeds, their range, and whether no other contender of the scene is better."""

    mean: str
    spread: str
    best: bool


class TableRow(NamedTuple):
    """One contender's line in a table."""

    contender: Contender
    seeds: int
    cells: Sequence[Any]


def write_benchmark_page(results: BenchmarkResults, command: str, path: Path) -> None:
    """Write the page; ``command`` is what made it."""
    path.write_text(render("benchmark.html", _context(results, command)), encoding="utf-8")


def _context(results: BenchmarkResults, command: str) -> dict[str, Any]:
    """Everything that the template names."""
    cells, summaries = results.cells, results.summaries()
    figure = plot_benchmark(results.curves)
    metrics = [metric for metric in METRICS if any(metric in s for s in summaries.values())]
    finished = [cell for cell in cells if cell.state == "finished"]
    named = {contender.method for contender in results.scores} | {cell.method for cell in cells}
    return {
        "command": command,
        "facts": _facts(cells, finished, len(named)),
        "finished": len(finished),
        "several_presets": len({cell.preset for cell in cells}) > 1,
        "chart": None if figure is None else Markup(svg_of(figure)),
        "labels": [label_of(metric) for metric in metrics],
        "summary": _by_scene(_summary_rows(summaries, metrics)),
        "protocols": _protocols(results.scores),
        "times": _time_tables(results.times),
        "ablations": {name: ablation for name, ablation in ABLATIONS.items() if name in named},
        "omissions": results.omissions(),
        "cells": cells,
        "warnings": sorted({f"{cell.scene}: {text}" for cell in cells for text in cell.warnings}),
        "machines": _machines(finished),
    }


def _facts(cells: Sequence[CellRecord], finished: Sequence[CellRecord], methods: int) -> list[str]:
    """What stands below the title."""
    counts = (
        (len({cell.scene for cell in cells}), "scene"),
        (len({cell.preset for cell in cells}), "preset"),
        (methods, "method"),
        (len({cell.seed for cell in cells}), "seed"),
    )
    facts = [f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in counts]
    facts.append(f"{len(finished)} of {len(cells)} runs finished")
    if finished:
        facts.append(f"{seconds_text(sum(cell.wall_s or 0.0 for cell in finished))} of training")
    return facts


def _summary_rows(summaries: Summaries, metrics: Sequence[str]) -> list[TableRow]:
    rows = []
    for contender, found in summaries.items():
        rivals = [other for name, other in summaries.items() if name.scene == contender.scene]
        cells = []
        for metric in metrics:
            label, summary = label_of(metric), found.get(metric)
            if summary is None:
                cells.append(SummaryCell("–", "", False))
                continue
            means = [rival[metric].mean for rival in rivals if metric in rival]
            best = max(means) if label.higher_is_better else min(means)
            low, high = label.text(summary.low), label.text(summary.high)
            spread = f"{low} to {high}" if low != high else ""
            is_best = len(means) > 1 and summary.mean == best
            cells.append(SummaryCell(label.text(summary.mean), spread, is_best))
        seeds = max((summary.seeds for summary in found.values()), default=0)
        rows.append(TableRow(contender, seeds, cells))
    return rows


def _time_tables(times: Sequence[TimeToTarget]) -> list[dict[str, Any]]:
    """One table for each metric: a line for each contender, a column for each target."""
    tables = []
    for metric in dict.fromkeys(row.metric for row in times):
        of_metric = [row for row in times if row.metric == metric]
        lines: dict[Contender, list[TimeToTarget]] = {}
        for row in of_metric:
            lines.setdefault(Contender(row.scene, row.preset, row.method), []).append(row)
        rows = [TableRow(name, line[0].seeds, line) for name, line in lines.items()]
        targets = [f"{value:g}" for value in dict.fromkeys(row.target for row in of_metric)]
        label = label_of(metric)
        tables.append({"label": label, "targets": targets, "groups": _by_scene(rows)})
    return tables


def _by_scene(rows: Sequence[TableRow]) -> list[list[TableRow]]:
    scenes = dict.fromkeys(row.contender.scene for row in rows)
    return [[row for row in rows if row.contender.scene == scene] for scene in scenes]


def _protocols(scores: Runs[ScoreRow]) -> list[str]:
    every = (rows for seeds in scores.values() for rows in seeds.values())
    return sorted({row.protocol for rows in every for row in rows if row.protocol})


def _machines(cells: Sequence[CellRecord]) -> list[str]:
    """Each machine once, in words."""
    described = (
        ", ".join(f"{name} {cell.machine[name]}" for name in MACHINE if name in cell.machine)
        for cell in cells
    )
    return list(dict.fromkeys(filter(None, described)))
