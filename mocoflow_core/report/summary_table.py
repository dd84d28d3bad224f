"""The table of scores: a row for each contender, a column for each metric, the best marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from mocoflow_core.methods.person_scores import PHOTOGRAPHS
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.report.metric_labels import label_of
from mocoflow_core.report.seed_summary import METRICS, Summaries

ABOUT_PHOTOGRAPHS = (
    "The photograph's row has the photographs in place of renders, which is the most that can be "
    "reached (OKS 1 and LPIPS 0 by definition); the shifted photograph's are their copies half a "
    "pixel off, which is how far the detectors agree with themselves."
)


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


def shown_metrics(summaries: Summaries) -> list[str]:
    """The metrics that any contender has, in their order."""
    return [metric for metric in METRICS if any(metric in found for found in summaries.values())]


def summary_rows(summaries: Summaries, metrics: Sequence[str]) -> list[TableRow]:
    """Rows in the order of the benchmark; rivals are the methods of the same scene."""
    rows = []
    for contender, found in summaries.items():
        rivals = [other for name, other in summaries.items() if _are_rivals(name, contender)]
        cells = []
        for metric in metrics:
            label, summary = label_of(metric), found.get(metric)
            if summary is None:
                cells.append(SummaryCell("–", "", False))
                continue
            means = [rival[metric].mean for rival in rivals if metric in rival]
            best = (max if label.higher_is_better else min)(means, default=None)
            low, high = label.text(summary.low), label.text(summary.high)
            spread = f"{low} to {high}" if low != high else ""
            is_best = (
                contender.method not in PHOTOGRAPHS and len(means) > 1 and summary.mean == best
            )
            cells.append(SummaryCell(label.text(summary.mean), spread, is_best))
        seeds = max((summary.seeds for summary in found.values()), default=0)
        rows.append(TableRow(contender, seeds, cells))
    return rows


def _are_rivals(one: Contender, other: Contender) -> bool:
    return one.scene == other.scene and one.method not in PHOTOGRAPHS


def by_scene(rows: Sequence[TableRow]) -> list[list[TableRow]]:
    """The rows of each scene together."""
    scenes = dict.fromkeys(row.contender.scene for row in rows)
    return [[row for row in rows if row.contender.scene == scene] for scene in scenes]
