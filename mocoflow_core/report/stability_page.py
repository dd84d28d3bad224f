"""The stability catalogue as one page: what is stiff, how far off it may be, how it went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup
from pydantic import JsonValue

from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.whole_file import whole_file
from mocoflow_core.report.curve_plot import svg_of
from mocoflow_core.report.stability_plot import plot_sweeps
from mocoflow_core.report.template import render
from mocoflow_core.stability.case import Case
from mocoflow_core.stability.catalogue import AREAS, about
from mocoflow_core.stability.table import StabilityRow, summarise, write_table

TABLE, PLOTS, PAGE = "stability.parquet", "plots", "stability.html"


class CaseLine(NamedTuple):
    """One case in the table, with the value of its sweep that came nearest to its bound."""

    case: Case[Any]
    passed: bool
    values: str  # first and last, or the words
    worst: StabilityRow
    error: str
    bound: str
    margin: str
    remark: str
    seconds: float


class AreaSection(NamedTuple):
    """One area: its cases and their sweeps."""

    name: str
    about: str
    lines: list[CaseLine]
    plot: Markup | None


def write_stability(
    rows: Sequence[StabilityRow], machine: Mapping[str, JsonValue], folder: Path
) -> None:
    """Write ``stability.parquet``, ``plots/<area>.png`` and ``stability.html``.

    The page needs nothing beside it. ``machine`` says what the seconds were measured on. Raises
    InputError where the disk is full.
    """
    with full_disk_is_bad_input(f"The folder {folder}"):
        folder.mkdir(parents=True, exist_ok=True)
        # First: by its table a folder is known as one that a later run may write into.
        with whole_file(folder / TABLE) as path:
            write_table(rows, path)
        # A page of an earlier run must not stand beside the table of this one.
        (folder / PAGE).unlink(missing_ok=True)
        _write_page(rows, machine, folder)


def _write_page(
    rows: Sequence[StabilityRow], machine: Mapping[str, JsonValue], folder: Path
) -> None:
    (folder / PLOTS).mkdir(exist_ok=True)
    areas = list(dict.fromkeys(row.area for row in rows))
    sections = []
    for area in areas:
        own = [row for row in rows if row.area == area]
        figure = plot_sweeps(own)
        if figure is not None:
            with whole_file(folder / PLOTS / f"{area}.png") as path:
                figure.savefig(path, dpi=80, facecolor="white")
        plot = None if figure is None else Markup(svg_of(figure))
        sections.append(AreaSection(area, about(area), _lines(own), plot))
    context = {"summary": summarise(rows), "areas": sections, "machine": machine}
    with whole_file(folder / PAGE) as path:
        path.write_text(render(PAGE, context), encoding="utf-8")


def _lines(rows: Sequence[StabilityRow]) -> list[CaseLine]:
    known = {case.name: case for case in AREAS[rows[0].area]}
    lines = []
    for name in dict.fromkeys(row.case for row in rows):
        sweep = [row for row in rows if row.case == name]
        worst = min(sweep, key=lambda row: (row.passed, row.margin))
        lines.append(
            CaseLine(
                known[name],
                all(row.passed for row in sweep),
                _values(sweep),
                worst,
                _number(worst.error),
                _number(worst.bound),
                _margin(worst),
                worst.remark or next((row.remark for row in sweep if row.remark), ""),
                sum(row.seconds for row in sweep),
            )
        )
    return lines


def _values(sweep: Sequence[StabilityRow]) -> str:
    if any(row.number is None for row in sweep):
        return ", ".join(row.value for row in sweep)
    numbers = [row.number for row in sweep if row.number is not None]
    return f"{min(numbers):.4g} to {max(numbers):.4g}" if len(numbers) > 1 else f"{numbers[0]:.4g}"


def _margin(row: StabilityRow) -> str:
    if not np.isfinite(row.error):
        return "–"
    return "exact" if row.error == 0 else f"{row.margin:.3g} ×"


def _number(value: float) -> str:
    return f"{value:.2g}" if np.isfinite(value) else "–"
