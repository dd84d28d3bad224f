"""Error against run time of everything that a benchmark compares, one panel for each scene."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mocoflow_core.metrics.benchmark_tables import Contender, Runs
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.seed_band import last_points, seed_band
from mocoflow_core.report.curve_plot import ACCENT, SVG_SETTINGS, WARM, plain_ticks
from mocoflow_core.report.inputs import BASELINE

METRIC = "psnr_union"  # Its error is the mean squared one over the person.
COLUMNS = 3
LEVEL = (0, (5, 3))
# Told apart by people who see red and green alike; the first is the page's own accent.
COLOURS = (ACCENT, "#5b4fc4", "#c0392b", "#2f7fbf", "#8a6d00", "#b0408a", "#5f6b1f", "#4a5568")
STYLES = ("-", "--", ":", "-.")


def plot_benchmark(runs: Runs[CurveRow]) -> Figure | None:
    """Log seconds of the training clock against log error; None where there is nothing to draw.

    A line is the median over seeds, its band their range, a dot where one seed ended. The posed
    mesh, which nothing makes better, is a level. A method keeps its colour over all panels; its
    presets differ in their dashes.
    """
    scenes = list(dict.fromkeys(contender.scene for contender in runs))
    if not scenes:
        return None
    columns = min(COLUMNS, len(scenes))
    lines = math.ceil(len(scenes) / columns)
    with mpl.rc_context(SVG_SETTINGS):
        figure = Figure(figsize=(max(4.2 * columns, 7.0), 3.7 * lines), layout="constrained")
        figure.patch.set_alpha(0.0)
        places = figure.subplots(lines, columns, squeeze=False).ravel()
        for axes, scene in zip(places, scenes, strict=False):
            _panel(axes, {c: seeds for c, seeds in runs.items() if c.scene == scene}, runs)
        for axes in places[len(scenes) :]:
            axes.set_axis_off()
        figure.legend(
            handles=legend(runs), loc="outside lower center", ncols=4, frameon=False, fontsize=8.5
        )
    return figure


def write_benchmark_chart(runs: Runs[CurveRow], path: Path) -> None:
    """Write the chart as a PNG; nothing where there is nothing to draw."""
    figure = plot_benchmark(runs)
    if figure is not None:
        # On a page of its own the chart is transparent; a picture may be shown on black.
        figure.patch.set_alpha(1.0)
        figure.savefig(path, dpi=110, facecolor="white")


def _panel(axes: Axes, shown: Runs[CurveRow], runs: Runs[CurveRow]) -> None:
    axes.patch.set_alpha(0.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for contender, seeds in shown.items():
        colour, style = look_of(contender, runs)
        ends = last_points(seeds.values(), METRIC)
        if contender.method == BASELINE:
            _level(axes, ends)
            continue
        axes.plot(ends[:, 0], ends[:, 1], "o", color=colour, ms=3.5, zorder=4)
        band = seed_band(seeds.values(), METRIC)
        if band is not None:
            axes.plot(band.seconds, band.median, style, color=colour, lw=1.8, zorder=3)
            if len(seeds) > 1:
                axes.fill_between(band.seconds, band.low, band.high, color=colour, alpha=0.2, lw=0)
    # A name is one line and no formula, whatever is in it.
    name = " ".join(next(iter(shown)).scene.split())
    axes.set_title(name, loc="left", fontsize=10.5, pad=8, parse_math=False)
    axes.set_ylabel("mean squared error over the person")
    axes.set_xlabel("seconds of the training clock")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(length=3, which="both")
    axes.margins(y=0.14)
    plain_ticks(axes)


def _level(axes: Axes, ends: np.ndarray) -> None:
    """A level at the median over seeds."""
    if len(ends):
        axes.axhline(float(np.median(ends[:, 1])), color=WARM, lw=1.2, ls=LEVEL, zorder=2)


def look_of(contender: Contender, all_shown: Iterable[Contender]) -> tuple[str, Any]:
    """Colour by method, dashes by preset; the posed mesh has its own."""
    if contender.method == BASELINE:
        return WARM, LEVEL
    every = list(all_shown)
    methods = [method for method in dict.fromkeys(c.method for c in every) if method != BASELINE]
    presets = list(dict.fromkeys(c.preset for c in every))
    place = methods.index(contender.method)
    return COLOURS[place % len(COLOURS)], STYLES[presets.index(contender.preset) % len(STYLES)]


def legend(all_shown: Iterable[Contender]) -> list[Line2D]:
    """One handle for each method, and each preset where there are several."""
    every = list(all_shown)
    several = len({contender.preset for contender in every}) > 1
    handles = {}
    for contender in every:
        name = contender.method.replace("_", " ")
        if several and contender.method != BASELINE:
            name = f"{name}, {contender.preset}"
        colour, style = look_of(contender, every)
        handles[name] = Line2D([], [], color=colour, ls=style, lw=1.8, label=name)
    return list(handles.values())
