"""CPU seconds against error: a line for each knob, through the defaults."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.knobs import DEFAULT, KNOBS
from benchmarks.precision_front import default_of
from benchmarks.precision_rows import Point, Row, points_of
from mocoflow_core.metrics.curve import as_error
from mocoflow_core.report.benchmark_chart import COLOURS, STYLES
from mocoflow_core.report.curve_plot import INK, SVG_SETTINGS, WARM, plain_ticks

COLUMNS = 2
BUDGET, JOINT = "budget", "joint"


def write_chart(rows: Sequence[Row], path: Path) -> None:
    """A panel for each scene: knobs as lines, budgets as a dashed one, joint settings as crosses.

    A point is the median of the seeds that the defaults' sweep was measured with.
    """
    points = points_of(rows, sweep_seeds(rows))
    scenes = list(dict.fromkeys(point.scene for point in points))
    lines = math.ceil(len(scenes) / COLUMNS)
    with mpl.rc_context(SVG_SETTINGS):
        figure = Figure(figsize=(5.6 * COLUMNS, 4.6 * lines), layout="constrained")
        places = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
        for axes, scene in zip(places, scenes, strict=False):
            _panel(axes, [point for point in points if point.scene == scene])
        for axes in places[len(scenes) :]:
            axes.set_axis_off()
        figure.legend(
            handles=_legend(points),
            loc="outside lower center",
            ncols=6,
            frameon=False,
            fontsize=8,
            handlelength=3.5,
        )
        figure.savefig(path, dpi=110, facecolor="white")


def sweep_seeds(rows: Sequence[Row]) -> range:
    """Those that every setting was measured with."""
    last: dict[tuple[str, str, str], int] = {}
    for row in rows:
        key = (row.scene, row.knob, row.value)
        last[key] = max(last.get(key, 0), row.seed)
    return range(1 + min(last.values()))


def _panel(axes: Axes, points: Sequence[Point]) -> None:
    default = default_of(points, points[0].scene)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for number, knob in enumerate(KNOBS):
        line = [p for p in points if p.knob == knob.name]
        if line:
            colour, style = _look(number)
            _line(axes, sorted([*line, default], key=lambda p: p.cpu_s), colour, style)
    budgets = [p for p in points if p.knob == BUDGET and p.steps > 0]
    _line(axes, budgets, WARM, (0, (5, 3)))
    for point in points:
        if point.knob == JOINT:
            axes.plot(point.cpu_s, _error(point), "x", color=INK, ms=6, zorder=5)
    axes.plot(default.cpu_s, _error(default), "*", color=INK, ms=13, zorder=6)
    axes.set_title(default.scene, loc="left", fontsize=10.5, pad=8)
    axes.set_xlabel("CPU seconds of the training clock")
    axes.set_ylabel("mean squared error over the person")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(length=3, which="both")
    plain_ticks(axes)


def _line(axes: Axes, line: Sequence[Point], colour: str, style: object) -> None:
    seconds, errors = [p.cpu_s for p in line], [_error(p) for p in line]
    axes.plot(seconds, errors, color=colour, ls=style, lw=1.4, marker="o", ms=3.5, zorder=3)


def _error(point: Point) -> float:
    return as_error("psnr_union", point.psnr_union)


def _look(number: int) -> tuple[str, str]:
    return COLOURS[number % len(COLOURS)], STYLES[number // len(COLOURS)]


def _legend(points: Sequence[Point]) -> list[Line2D]:
    shown = {point.knob for point in points}
    handles = [Line2D([], [], color=INK, marker="*", ms=11, ls="", label=DEFAULT.knob)]
    for number, knob in enumerate(KNOBS):
        if knob.name in shown:
            colour, style = _look(number)
            handles.append(
                Line2D([], [], color=colour, ls=style, marker="o", ms=3.5, label=knob.name)
            )
    if BUDGET in shown:
        handles.append(Line2D([], [], color=WARM, ls=(0, (5, 3)), marker="o", ms=3.5, label=BUDGET))
    if JOINT in shown:
        handles.append(Line2D([], [], color=INK, marker="x", ls="", label="several together"))
    return handles
