"""Sweeps of the stability catalogue: error and bound against what is swept."""

from __future__ import annotations

import math
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mocoflow_core.report.curve_plot import ACCENT, INK, QUIET, SVG_SETTINGS, WARM
from mocoflow_core.stability.table import StabilityRow

COLUMNS = 3
FAILED = "#be123c"
# An error of zero has no place on a logarithmic axis: it stands at the bottom, this far below.
DECADES_BELOW = 2.0
EXACT = 1e-18


def plot_sweeps(rows: Sequence[StabilityRow]) -> Figure | None:
    """One panel for each case of an area that sweeps something; None where there is none."""
    cases = [
        sweep
        for name in dict.fromkeys(row.case for row in rows)
        if len(sweep := [row for row in rows if row.case == name]) > 1
    ]
    if not cases:
        return None
    lines = -(-len(cases) // COLUMNS)
    with mpl.rc_context(SVG_SETTINGS):
        figure = Figure(figsize=(4.2 * COLUMNS, 3.1 * lines), layout="constrained")
        figure.patch.set_alpha(0.0)
        places = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
        for axes, sweep in zip(places, cases, strict=False):
            _panel(axes, sweep)
        for axes in places[len(cases) :]:
            axes.set_axis_off()
    return figure


def _panel(axes: Axes, sweep: Sequence[StabilityRow]) -> None:
    axes.patch.set_alpha(0.0)
    axes.set_title(sweep[0].case.replace("_", " "), loc="left", fontsize=10.5, pad=8, color=INK)
    bounds = np.array([row.bound for row in sweep])
    errors = np.array([row.error for row in sweep])
    floor = _floor(errors, bounds)
    places = _places(axes, sweep)
    axes.set_yscale("log")
    axes.plot(places, np.maximum(bounds, floor), color=WARM, lw=1.2, ls=(0, (5, 3)), zorder=2)
    axes.plot(places, np.maximum(errors, floor), color=ACCENT, lw=1.6, zorder=3)
    for place, row in zip(places, sweep, strict=True):
        known = math.isfinite(row.error)
        height = max(row.error, floor) if known else max(row.bound, floor)
        colour = ACCENT if row.passed else FAILED
        axes.plot(place, height, "o" if known else "x", color=colour, ms=4.0, zorder=4)
    axes.set_xlabel(sweep[0].parameter)
    unit = sweep[0].unit
    axes.set_ylabel(f"error, {unit}" if unit else "error")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(QUIET)
    axes.tick_params(length=3, which="both")
    axes.minorticks_off()
    axes.margins(y=0.14)


def _floor(errors: np.ndarray, bounds: np.ndarray) -> float:
    """Where an error of zero is drawn: below everything that has a place of its own."""
    seen = np.concatenate([errors[errors > 0], bounds[bounds > 0]])
    return float(seen.min()) * 10.0**-DECADES_BELOW if len(seen) else EXACT


def _places(axes: Axes, sweep: Sequence[StabilityRow]) -> np.ndarray:
    """Where the values stand along the axis: as numbers where they span decades, else in order."""
    numbers = [row.number for row in sweep]
    known = [number for number in numbers if number is not None]
    if len(known) == len(sweep) and all(math.isfinite(number) for number in known):
        positive = [number for number in known if number > 0]
        if min(known) >= 0 and len(positive) > 1 and max(positive) > 100 * min(positive):
            axes.set_xscale("symlog", linthresh=min(positive), linscale=0.5)
        return np.array(known)
    axes.set_xticks(
        range(len(sweep)),
        [row.value.replace(", ", "\n") for row in sweep],
        rotation=0 if len(sweep) < 5 and max(len(row.value) for row in sweep) < 9 else 25,
        ha="center" if len(sweep) < 5 and max(len(row.value) for row in sweep) < 9 else "right",
        fontsize=7.5,
    )
    return np.arange(len(sweep), dtype=float)
