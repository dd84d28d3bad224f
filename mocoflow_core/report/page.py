"""The report: one HTML file that needs nothing beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from mocoflow_core.metrics.curve import read_curve, training_spans
from mocoflow_core.metrics.table import ScoreRow, mean_scores, read_scores
from mocoflow_core.report import videos
from mocoflow_core.report.correspondences import correspondences
from mocoflow_core.report.curve_plot import plot_curve, svg_of
from mocoflow_core.report.held_out_views import held_out_views
from mocoflow_core.report.inputs import BASELINE, ReportInputs
from mocoflow_core.report.metric_labels import BODY_METRICS
from mocoflow_core.report.score_tables import headlines, repairs, view_table
from mocoflow_core.report.template import FOLDER, render


class StageBar(NamedTuple):
    """One stage's seconds, and its share of the longest stage for the bar."""

    name: str
    wall_s: float
    cpu_s: float
    cached: bool
    share: float


def write_report(inputs: ReportInputs, path: Path) -> None:
    """Write the page of a run; it holds its pictures and videos and stays below 15 MB."""
    path.write_text(render("page.html", _context(inputs)), encoding="utf-8")


def _context(inputs: ReportInputs) -> dict[str, Any]:
    """Everything that the template names."""
    rows = read_scores(inputs.scores) if inputs.scores else []
    run = inputs.run
    stages = _stage_bars(run.get("stages", ()))
    clock = training_spans(run.get("stages", ()))
    decisions = [_decision(decision) for decision in inputs.decisions]
    turntable = videos.turntable(inputs.turntable) if inputs.turntable else None
    novel = (
        videos.side_by_side(inputs.seen, inputs.novel_view)
        if inputs.seen and inputs.novel_view
        else None
    )
    return {
        "script": Markup((FOLDER / "page.js").read_text()),
        "run": run,
        "method": inputs.method,
        "facts": _facts(inputs),
        "headlines": headlines(rows, inputs.method, inputs.train_camera),
        "clock_s": clock[-1].end_s if clock else None,
        "total_s": sum(stage.wall_s for stage in stages),
        "fresh_s": sum(stage.wall_s for stage in stages if not stage.cached),
        "side_by_side": novel,
        "novel_camera": inputs.novel_camera,
        "turntable": turntable,
        "cameras": held_out_views(inputs, rows),
        "correspondences": correspondences(inputs),
        "table": view_table(rows, inputs.train_camera),
        "repairs": repairs(rows, inputs.method),
        "curve": _curve(inputs, rows),
        "held_out": inputs.held_out,
        "left_out": [decision for decision in decisions if not decision["needed"]],
        "kept": [decision for decision in decisions if decision["needed"]],
        "stages": stages,
        "machine": run.get("machine", {}),
        "warnings": list(inputs.warnings),
        "guard_events": list(inputs.guard_events),
        "settings": json.dumps(run.get("configuration", {}), indent=2),
    }


def _facts(inputs: ReportInputs) -> list[str]:
    """What stands below the title."""
    run, clip = inputs.run, inputs.seen
    facts = [f"preset {run['preset']}"] if "preset" in run else []
    facts += [f"seed {run['seed']}"] if "seed" in run else []
    if clip is not None:
        size = f"{clip.camera.width} × {clip.camera.height}"
        facts.append(f"{len(clip.frame_indices)} frames of {size} at {clip.fps:g} fps")
        facts.append(f"seen by {clip.camera.name} alone")
    return facts


def _stage_bars(stages: Sequence[Mapping[str, Any]]) -> list[StageBar]:
    longest = max([float(stage["wall_s"]) for stage in stages], default=0.0) or 1.0
    return [
        StageBar(
            str(stage["name"]),
            float(stage["wall_s"]),
            float(stage["cpu_s"]),
            bool(stage.get("cached", False)),
            float(stage["wall_s"]) / longest,
        )
        for stage in stages
    ]


def _decision(decision: Mapping[str, Any]) -> dict[str, Any]:
    """A decision of the plan with its evidence in words."""
    measured = decision["evidence"].items()
    evidence = [f"{name.replace('_', ' ')} {_number(value)}" for name, value in measured]
    threshold = decision.get("threshold")
    return {
        "name": decision["name"],
        "needed": decision["needed"],
        "reason": decision["reason"],
        "evidence": ", ".join(evidence),
        "threshold": "" if threshold is None else _number(threshold),
        "saves": decision.get("saves", ""),
    }


def _number(value: Any) -> str:  # noqa: ANN401  (JSON holds numbers and text alike)
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _curve(inputs: ReportInputs, rows: Sequence[ScoreRow]) -> Markup | None:
    """The error curve of this run's method, with the level of the posed mesh."""
    if inputs.curve is None:
        return None
    curve = read_curve(inputs.curve)
    # The same views as along the curve where they were scored, all views otherwise.
    level = {row.metric: row.value for row in curve if row.method == BASELINE}
    figure = plot_curve(
        [row for row in curve if row.method == inputs.method],
        training_spans(inputs.run.get("stages", ())),
        level or _baseline(inputs, rows),
    )
    return None if figure is None else Markup(svg_of(figure))


def _baseline(inputs: ReportInputs, rows: Sequence[ScoreRow]) -> dict[str, float]:
    """Mean scores of the posed mesh over the held-out cameras, or over the train camera's."""
    novel = [row for row in rows if row.camera != inputs.train_camera]
    judged = (novel or list(rows)) + [row for row in rows if row.metric in BODY_METRICS]
    return mean_scores(row._replace(camera="") for row in judged).get(BASELINE, {}).get("", {})
