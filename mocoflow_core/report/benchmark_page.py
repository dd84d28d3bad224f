"""The page of a benchmark: one HTML file that needs nothing beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from mocoflow_core.io.machine import described
from mocoflow_core.methods.ablations import change_of
from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.methods.person_scores import PHOTOGRAPHS
from mocoflow_core.metrics.benchmark_tables import Contender, Runs
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import TimeToTarget
from mocoflow_core.report.benchmark_chart import plot_benchmark
from mocoflow_core.report.benchmark_results import BenchmarkResults
from mocoflow_core.report.curve_plot import svg_of
from mocoflow_core.report.history_chart import plot_history
from mocoflow_core.report.history_words import in_words, margins_in_words
from mocoflow_core.report.metric_labels import label_of
from mocoflow_core.report.misalignment_table import misalignment_tables
from mocoflow_core.report.summary_table import (
    ABOUT_PHOTOGRAPHS,
    TableRow,
    by_scene,
    shown_metrics,
    summary_rows,
)
from mocoflow_core.report.template import render, seconds_text

# Of a machine's description; the load differs from cell to cell.
MACHINE = ("model", "cores", "threads", "system", "python")


def write_benchmark_page(results: BenchmarkResults, command: str, path: Path) -> None:
    """Write the page; ``command`` is what made it."""
    path.write_text(render("benchmark.html", _context(results, command)), encoding="utf-8")


def _context(results: BenchmarkResults, command: str) -> dict[str, Any]:
    """Everything that the template names."""
    cells, summaries = results.cells, results.summaries()
    figure = plot_benchmark(results.curves)
    metrics = shown_metrics(summaries)
    finished = [cell for cell in cells if cell.state == "finished"]
    methods = (*(contender.method for contender in results.scores), *(c.method for c in cells))
    named = list(dict.fromkeys(methods))
    return {
        "command": command,
        "experiment": results.experiment,
        "facts": _facts(cells, finished, len([name for name in named if name not in PHOTOGRAPHS])),
        "photographs": any(name in PHOTOGRAPHS for name in named),
        "about_photographs": ABOUT_PHOTOGRAPHS,
        "finished": len(finished),
        "several_presets": len({cell.preset for cell in cells}) > 1,
        "chart": None if figure is None else Markup(svg_of(figure)),
        "labels": [label_of(metric) for metric in metrics],
        "summary": by_scene(summary_rows(summaries, metrics)),
        "protocols": _protocols(results.scores),
        "times": _time_tables(results.times),
        "changes": {name: change for name in named if (change := change_of(name))},
        **_nights(results),
        "misplaced": misalignment_tables(results.misplaced),
        "misplaced_protocols": sorted({row.protocol for row in results.misplaced}),
        "omissions": results.omissions(),
        "cells": cells,
        "warnings": sorted({f"{cell.scene}: {text}" for cell in cells for text in cell.warnings}),
        "machines": _machines(finished),
    }


def _nights(results: BenchmarkResults) -> dict[str, Any]:
    """What the history's section shows."""
    found = results.regressions()
    figure = plot_history(results.past, results.tonight(), found)
    return {
        "nights": len({row.night for row in results.past}),
        "history": None if figure is None else Markup(svg_of(figure)),
        "margins": margins_in_words(),
        "regressions": in_words(found),
    }


def _facts(cells: Sequence[CellRecord], finished: Sequence[CellRecord], methods: int) -> list[str]:
    """What stands below the title; nothing where nothing was to be run."""
    if not cells:
        return []
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
        tables.append({"label": label, "targets": targets, "groups": by_scene(rows)})
    return tables


def _protocols(scores: Runs[ScoreRow]) -> list[str]:
    every = (rows for seeds in scores.values() for rows in seeds.values())
    return sorted({row.protocol for rows in every for row in rows if row.protocol})


def _machines(cells: Sequence[CellRecord]) -> list[str]:
    """Each machine once, in words."""
    each = (described(cell.machine, MACHINE) for cell in cells)
    return list(dict.fromkeys(filter(None, each)))
