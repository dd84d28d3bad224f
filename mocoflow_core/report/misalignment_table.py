"""Misplaced views as a table: a line for each displacement, a column for each score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mocoflow_core.metrics.misalignment import MisalignmentRow
from mocoflow_core.report.metric_labels import MetricLabel, label_of


class MisplacedLine(NamedTuple):
    """One displacement with its scores as text."""

    name: str
    values: list[str]


class MisplacedTable(NamedTuple):
    """The displacements of one scene's views."""

    scene: str
    labels: list[MetricLabel]
    rows: list[MisplacedLine]


def misalignment_tables(rows: Sequence[MisalignmentRow]) -> list[MisplacedTable]:
    """One table for each scene."""
    scenes = dict.fromkeys(row.scene for row in rows)
    return [_table(scene, [row for row in rows if row.scene == scene]) for scene in scenes]


def _table(scene: str, rows: Sequence[MisalignmentRow]) -> MisplacedTable:
    metrics = list(dict.fromkeys(row.metric for row in rows))
    lines: dict[str, dict[str, str]] = {}
    for row in rows:
        lines.setdefault(_name(row), {})[row.metric] = label_of(row.metric).text(row.value)
    return MisplacedTable(
        scene,
        [label_of(metric) for metric in metrics],
        [
            MisplacedLine(name, [found.get(metric, "–") for metric in metrics])
            for name, found in lines.items()
        ],
    )


def _name(row: MisalignmentRow) -> str:
    here = "" if row.moved_px is None else f" ({row.moved_px:.1f})"
    return f"{row.misplaced} by {row.amount:g} {row.unit}{here}"
