"""Scores arranged for reading: per camera and method, before and after, and the key numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from mocoflow_core.methods.person_scores import OKS, PHOTOGRAPH, PHOTOGRAPHS, SHIFTED_PHOTOGRAPH
from mocoflow_core.metrics.bootstrap import mean_interval
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.report.inputs import BASELINE
from mocoflow_core.report.metric_labels import (
    BODY_METRICS,
    VIEW_METRICS,
    MetricLabel,
    label_of,
)

HEADLINES = ("psnr_union", "ssim", "mask_iou", "plausibility", "oks", "keypoint_mm")


class Cell(NamedTuple):
    """One mean, its 95 % interval over the views (empty where there are too few), and whether no
    other method of the camera is better."""

    text: str
    interval: str
    best: bool


class CameraRow(NamedTuple):
    """The means of one method at one camera."""

    camera: str
    method: str
    views: int
    cells: list[Cell]


class ViewTable(NamedTuple):
    """Mean scores with the protocols they were measured under."""

    labels: list[MetricLabel]
    groups: list[list[CameraRow]]  # one for each camera, one row for each method
    protocols: list[str]


class Repair(NamedTuple):
    """An error before and after the optimisation."""

    title: str
    before: str
    after: str
    change: str
    better: bool


class Headline(NamedTuple):
    """One key number of the run."""

    title: str
    value: str
    unit: str
    note: str


def view_table(rows: Sequence[ScoreRow], train_camera: str) -> ViewTable:
    """Means over frames for each camera and method, held-out cameras together on top."""
    rows = [row for row in rows if row.metric not in BODY_METRICS]
    metrics = _ordered({row.metric for row in rows})
    cameras = sorted({row.camera for row in rows}, key=lambda name: (name == train_camera, name))
    others = [camera for camera in cameras if camera != train_camera]
    groups = [(camera, [camera]) for camera in cameras]
    if len(others) > 1:
        groups.insert(0, (f"all {len(others)} held-out cameras", others))
    table = []
    for title, members in groups:
        suffix = ", held-out frames" if members == [train_camera] else ""
        members_rows = [row for row in rows if row.camera in members]
        table.append(_camera_rows(title + suffix, members_rows, metrics))
    protocols = sorted({row.protocol for row in rows if row.protocol})
    return ViewTable([label_of(metric) for metric in metrics], table, protocols)


def repairs(rows: Sequence[ScoreRow], method: str) -> list[Repair]:
    """Errors of motion and shape, medians over frames; before = what the given mesh had."""
    found = []
    for metric, label in BODY_METRICS.items():
        before = _values(rows, BASELINE, metric)
        after = _values(rows, method, metric)
        if not after and not before:
            continue
        old = float(np.nanmedian(before)) if before else float("nan")
        new = float(np.nanmedian(after)) if after else float("nan")
        change = _change(old, new, label)
        found.append(
            Repair(label.title, label.with_unit(old), label.with_unit(new), change, new < old)
        )
    return found


def _change(old: float, new: float, label: MetricLabel) -> str:
    """The change in per cent; empty where the table's digits show none, or no error before."""
    if label.text(old) == label.text(new) or float(label.text(0.0)) == round(old, label.digits):
        return ""
    return f"{100 * (new - old) / old:+.0f} %" if np.isfinite(old + new) else ""


def headlines(rows: Sequence[ScoreRow], method: str, train_camera: str) -> list[Headline]:
    """The key numbers over held-out cameras, or over the train camera's held-out frames."""
    ours = key_numbers(rows, method, train_camera)
    theirs = key_numbers(rows, BASELINE, train_camera)
    most = key_numbers(rows, PHOTOGRAPH, train_camera)
    moved = key_numbers(rows, SHIFTED_PHOTOGRAPH, train_camera)
    found = []
    for metric in HEADLINES:
        if metric not in ours:
            continue
        label, notes = label_of(metric), []
        if metric in theirs:
            name = "before" if metric in BODY_METRICS else "posed mesh"
            notes.append(f"{name} {label.text(theirs[metric])}")
        if metric == OKS and metric in moved:
            notes.append(f"shifted photographs {label.text(moved[metric])}")
        elif metric in most:
            notes.append(f"photographs {label.text(most[metric])}")
        text = label.text(ours[metric])
        found.append(Headline(label.title, text, label.unit, ", ".join(notes)))
    return found


def key_numbers(rows: Sequence[ScoreRow], method: str, train_camera: str) -> dict[str, float]:
    """One number for each metric of a method in a run.

    Pictures: the mean over other cameras or, where a score has none, over the train camera's
    held-out frames. Motion and shape: the median over frames.
    """
    numbers = {}
    for metric in dict.fromkeys(row.metric for row in rows):
        named = [row for row in rows if row.metric == metric]
        novel = [row for row in named if row.camera != train_camera]
        body = metric in BODY_METRICS
        if values := _values(named if body else novel or named, method, metric):
            numbers[metric] = float(np.nanmedian(values) if body else np.mean(values))
    return numbers


def _camera_rows(title: str, rows: list[ScoreRow], metrics: list[str]) -> list[CameraRow]:
    methods = list(dict.fromkeys(row.method for row in rows))
    values = {(m, metric): _values(rows, m, metric) for m in methods for metric in metrics}
    means = {key: float(np.mean(found)) if found else float("nan") for key, found in values.items()}
    rivals = [method for method in methods if method not in PHOTOGRAPHS]
    table = []
    for method in methods:
        views = max(len(values[method, metric]) for metric in metrics)
        cells = [
            Cell(
                label_of(metric).text(means[method, metric]),
                _interval(values[method, metric], label_of(metric)),
                method in rivals
                and _is_best(means[method, metric], [means[m, metric] for m in rivals], metric),
            )
            for metric in metrics
        ]
        table.append(CameraRow(title, method, views, cells))
    return table


def _interval(values: list[float], label: MetricLabel) -> str:
    low, high = mean_interval(values)
    return "" if np.isnan(low) else f"{label.text(low)}–{label.text(high)}"


def _is_best(value: float, all_values: list[float], metric: str) -> bool:
    known = [other for other in all_values if not np.isnan(other)]
    if len(known) < 2:
        return False
    return value == (max(known) if label_of(metric).higher_is_better else min(known))


def _values(rows: Iterable[ScoreRow], method: str, metric: str) -> list[float]:
    return [row.value for row in rows if row.method == method and row.metric == metric]


def _ordered(metrics: set[str]) -> list[str]:
    known = [metric for metric in VIEW_METRICS if metric in metrics]
    return known + sorted(metrics - set(known))
