"""Error against run time, drawn with the stages of the run shaded."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from mocoflow_core.metrics.curve import NETWORK_METRICS, CurveRow, StageSpan, as_error
from mocoflow_core.report.metric_labels import label_of

PANELS = ("psnr_union", "train_psnr", "mask_iou", "ssim", "keypoint_mm", "correspondence_mm")
ERROR_NAMES = {
    "ssim": "1 - SSIM",
    "mask_iou": "1 - mask overlap",
    "plausibility": "1 - plausibility",
    "oks": "1 - OKS",
}
INK, QUIET, ACCENT, WARM = "#3c3f44", "#8a8f98", "#0f766e", "#b45309"
STAGE_COLOURS = ("#b9c9d8", "#e6d3b0", "#c6d9bf", "#e6c9c9", "#cdc6e2", "#bcdcd9", "#dfdfbd")
# Text stays text, in the page's own font; ids do not depend on the moment.
SVG_SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "error curve",
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
}


def plot_curve(
    rows: Sequence[CurveRow],
    spans: Sequence[StageSpan],
    baseline: Mapping[str, float] | None = None,
    columns: int = 3,
) -> Figure | None:
    """One panel for each metric: log seconds against log error.

    Several seeds are drawn as their median with the range between the best and the worst. What
    networks say, where it was measured, has a line of panels of its own.

    Args:
        rows: of one method on one scene.
        spans: the stages on the training clock, to be shaded.
        baseline: value of a metric without any optimisation, drawn as a level.

    Returns:
        None when the rows hold no metric that can be drawn.
    """
    rows = [row for row in rows if np.isfinite(row.value)]
    lines = _panels({row.metric for row in rows}, columns)
    if not lines:
        return None
    width = max(map(len, lines))
    with mpl.rc_context(SVG_SETTINGS):
        figure = Figure(figsize=(4.2 * width, 3.7 * len(lines)), layout="constrained")
        figure.patch.set_alpha(0.0)
        places = figure.subplots(len(lines), width, squeeze=False)
        for line, metrics in zip(places, lines, strict=True):
            for axes, metric in zip(line, metrics, strict=False):
                _panel(axes, [row for row in rows if row.metric == metric], metric)
                _level(axes, metric, (baseline or {}).get(metric))
                _shade(axes, spans, min(row.wall_s for row in rows), max(row.cpu_s for row in rows))
                plain_ticks(axes)
            for axes in line[len(metrics) :]:
                axes.set_axis_off()
        figure.legend(
            handles=_legend(spans, bool(baseline)),
            loc="outside lower center",
            ncols=6,
            frameon=False,
            fontsize=8.5,
        )
    return figure


def _panels(metrics: Collection[str], columns: int) -> list[list[str]]:
    """The metrics of each line of panels."""
    usual = [metric for metric in PANELS if metric in metrics][:columns]
    networks = [metric for metric in NETWORK_METRICS if metric in metrics][:columns]
    usual = usual or sorted(set(metrics) - set(networks))[:columns]
    return [line for line in (usual, networks) if line]


def svg_of(figure: Figure) -> str:
    """The figure as an ``<svg>`` element for a page."""
    buffer = io.StringIO()
    with mpl.rc_context(SVG_SETTINGS):
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _panel(axes: Axes, rows: Sequence[CurveRow], metric: str) -> None:
    axes.patch.set_alpha(0.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for clock, style, width in (("cpu_s", ":", 1.1), ("wall_s", "-", 1.8)):
        seconds, errors = _by_step(rows, metric, clock)
        axes.plot(seconds, np.median(errors, axis=1), style, color=ACCENT, lw=width, zorder=3)
        if clock == "wall_s":
            axes.plot(seconds, np.median(errors, axis=1), "o", color=ACCENT, ms=3.5, zorder=4)
            if errors.shape[1] > 1:
                axes.fill_between(
                    seconds, errors.min(axis=1), errors.max(axis=1), color=ACCENT, alpha=0.2, lw=0
                )
    last = max(rows, key=lambda row: row.wall_s)
    axes.annotate(
        label_of(metric).with_unit(last.value),
        (last.wall_s, as_error(metric, last.value)),
        xytext=(0, -15),
        textcoords="offset points",
        ha="center",
        color=ACCENT,
        fontweight="bold",
    )
    title = label_of(metric).title
    axes.set_title(title, loc="left", fontsize=10.5, pad=8)
    axes.set_ylabel("mean squared error" if "psnr" in metric else ERROR_NAMES.get(metric, title))
    axes.set_xlabel("seconds of the training clock")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(length=3, which="both")
    axes.margins(y=0.14)


def plain_ticks(axes: Axes) -> None:
    """Numbers as people write them, at 1, 2, 5 of each decade, or closer on a short axis."""
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        close = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8) if high / low <= 4 else (1, 2, 3, 5, 7)
        axis.set_major_locator(LogLocator(subs=close if high / low <= 10 else (1, 2, 5)))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))


def _by_step(rows: Sequence[CurveRow], metric: str, clock: str) -> tuple[np.ndarray, np.ndarray]:
    """Median seconds (S,) and errors (S, seeds) at the checkpoints that every seed has."""
    seeds = sorted({row.seed for row in rows})
    ordered = sorted(rows, key=lambda row: row.wall_s)
    by_seed = [[row for row in ordered if row.seed == seed] for seed in seeds]
    count = min(map(len, by_seed))
    seconds = np.array([[getattr(row, clock) for row in run[:count]] for run in by_seed])
    errors = np.array([[as_error(metric, row.value) for row in run[:count]] for run in by_seed])
    # Neither a time nor an error of zero has a place on a logarithmic axis.
    return np.maximum(np.median(seconds, axis=0), 1e-3), np.maximum(errors.T, 1e-6)


def _level(axes: Axes, metric: str, value: float | None) -> None:
    if value is not None:
        axes.axhline(as_error(metric, value), color=WARM, lw=1.2, ls=(0, (5, 3)), zorder=2)


def _shade(axes: Axes, spans: Sequence[StageSpan], first_s: float, last_s: float) -> None:
    """Bands behind the curve; the time axis begins shortly before what can be seen of them."""
    earliest = min([first_s, *(span.end_s for span in spans if span.end_s > 0)])
    begin = max(0.6 * earliest, 0.02 * first_s, 1e-2)
    for span, colour in zip(spans, _colours(spans), strict=True):
        if span.end_s > begin:
            axes.axvspan(max(span.start_s, begin), span.end_s, color=colour, alpha=0.55, lw=0)
    axes.set_xlim(begin, 1.25 * max([last_s, *(span.end_s for span in spans)]))


def _colours(spans: Sequence[StageSpan]) -> list[str]:
    return [STAGE_COLOURS[position % len(STAGE_COLOURS)] for position in range(len(spans))]


def _legend(spans: Sequence[StageSpan], compared: bool) -> list[Line2D | Patch]:
    lines = [
        Line2D([], [], color=ACCENT, lw=1.8, marker="o", ms=3.5, label="wall seconds"),
        Line2D([], [], color=ACCENT, lw=1.1, ls=":", label="CPU seconds"),
    ]
    if compared:
        lines.append(Line2D([], [], color=WARM, lw=1.2, ls=(0, (5, 3)), label="posed mesh"))
    stages = [
        Patch(color=colour, alpha=0.55, lw=0, label=span.name.replace("_", " "))
        for span, colour in zip(spans, _colours(spans), strict=True)
    ]
    return [*lines, *stages]
