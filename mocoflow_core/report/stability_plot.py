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
MOST_TICKS = 5


def plot_sweeps(rows: Sequence[StabilityRow]) -> Figure | None:
    """One panel for each case of an area that has something to show; None where none has."""
    sweeps = [
        [row for row in rows if row.case == name]
        for name in dict.fromkeys(row.case for row in rows)
    ]
    # Refusals have neither error nor bound.
    cases = [s for s in sweeps if len(s) > 1 and any(row.bound > 0 or row.error != 0 for row in s)]
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
    if sweep[0].number is not None:
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


def _decades(axes: Axes, positive: Sequence[float], zero: bool) -> None:
    """A logarithmic axis that has a place for zero, with a handful of ticks."""
    axes.set_xscale("symlog", linthresh=min(positive), linscale=0.5)
    low, high = (math.floor(math.log10(value)) for value in (min(positive), max(positive)))
    step = max(math.ceil((high - low) / (MOST_TICKS - 1)), 1)
    ticks = [10.0**decade for decade in range(high, low - 1, -step) if decade > -300]
    axes.set_xticks([0.0, *reversed(ticks)] if zero else list(reversed(ticks)))
    axes.set_xlim(left=-0.2 * min(positive) if zero else 0.7 * min(positive))


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
            _decades(axes, positive, 0.0 in known)
        return np.array(known)
    axes.set_xticks(range(len(sweep)), [_broken(row.value) for row in sweep], fontsize=7.5)
    axes.margins(x=0.12)
    return np.arange(len(sweep), dtype=float)


def _broken(words: str) -> str:
    """One word a line."""
    return words.replace(" ", "\n")
