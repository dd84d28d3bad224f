"""The error curve as a picture file, for pages that show no SVG."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from mocoflow_core.metrics.curve import read_curve, training_spans
from mocoflow_core.report.curve_plot import plot_curve
from mocoflow_core.report.inputs import BASELINE


def write_curve_picture(
    curve: Path, stages: Iterable[Mapping[str, object]], method: str, path: Path
) -> None:
    """Write a PNG of one run's curve; nothing where the curve is empty."""
    rows = read_curve(curve)
    level = {row.metric: row.value for row in rows if row.method == BASELINE}
    figure = plot_curve(
        [row for row in rows if row.method == method], training_spans(stages), level
    )
    if figure is not None:
        # On a page of its own the plot is transparent; a picture may be shown on black.
        figure.patch.set_alpha(1.0)
        figure.savefig(path, dpi=80, facecolor="white")
