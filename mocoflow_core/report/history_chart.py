"""A benchmark over its nights: the error and the seconds of everything that it compares."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.history import NOW, HistoryRow, Regression
from mocoflow_core.report.benchmark_chart import legend, look_of
from mocoflow_core.report.curve_plot import SVG_SETTINGS, WARM
from mocoflow_core.report.metric_labels import label_of

MEASURES = ("psnr_union", "cpu_s")


def plot_history(
    past: Sequence[HistoryRow], now: Sequence[HistoryRow], flagged: Sequence[Regression]
) -> Figure | None:
    """One line of panels for each scene; None where there was no earlier night.

    Nights stand in their order, this one last; what is flagged has a ring.
    """
    if not any(row.measure in MEASURES for row in past):
        return None
    rows = [row for row in (*now, *past) if row.measure in MEASURES]
    contenders = list(dict.fromkeys(row.contender for row in rows))
    scenes = list(dict.fromkeys(contender.scene for contender in contenders))
    nights = [*sorted({row.night for row in past}), NOW]
    rings = {(found.contender, found.measure) for found in flagged}
    with mpl.rc_context(SVG_SETTINGS):
        size = (8.4, 0.7 + 2.5 * len(scenes))
        figure = Figure(figsize=size, layout="constrained")
        figure.patch.set_alpha(0.0)
        places = figure.subplots(len(scenes), len(MEASURES), squeeze=False)
        for scene, line in zip(scenes, places, strict=True):
            for measure, axes in zip(MEASURES, line, strict=True):
                shown = [r for r in rows if r.scene == scene and r.measure == measure]
                _panel(axes, shown, nights, contenders, rings)
                axes.set_ylabel(label_of(measure).with_title())
            line[0].set_title(" ".join(scene.split()), loc="left", fontsize=10.5, parse_math=False)
        figure.legend(
            handles=legend(contenders), loc="outside lower center", ncols=4, frameon=False,
            fontsize=8.5,
        )  # fmt: skip
    return figure


def _panel(
    axes: Axes,
    rows: Sequence[HistoryRow],
    nights: Sequence[str],
    contenders: Sequence[Contender],
    rings: set[tuple[Contender, str]],
) -> None:
    axes.patch.set_alpha(0.0)
    for contender in dict.fromkeys(row.contender for row in rows):
        points = sorted((nights.index(r.night), r.value) for r in rows if r.contender == contender)
        colour, style = look_of(contender, contenders)
        x, y = zip(*points, strict=True)
        axes.plot(x, y, ls=style, color=colour, lw=1.4, marker="o", ms=3)
        if x[-1] == len(nights) - 1 and (contender, rows[0].measure) in rings:
            axes.plot(x[-1], y[-1], "o", ms=10, mfc="none", mec=WARM, mew=1.6, zorder=4)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.xaxis.set_major_formatter(lambda x, _: _night(nights, round(x)))
    axes.set_xlim(-0.4, len(nights) - 0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(length=3)
    axes.margins(y=0.2)


def _night(nights: Sequence[str], place: int) -> str:
    """Month and day; the last one is this night."""
    if not 0 <= place < len(nights):
        return ""
    return nights[place][5:10] or "now"
