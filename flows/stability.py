"""Flow stability: the catalogue of stiff and extreme cases goes in, a table and a page come out."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from prefect import flow
from prefect.artifacts import create_table_artifact

from flows.allowed_folders import AllowedFolders
from flows.results_folders import folder_of_this_run
from mocoflow_core.errors import InputError
from mocoflow_core.stability.catalogue import AREAS, cases_of, require_areas
from mocoflow_core.stability.table import StabilityRow, Summary, summarise
from tasks.check_stability import check_stability
from tasks.write_stability import write_stability

Area = Literal[tuple(AREAS)]
TABLE = "stability.parquet"


class CasesFailed(RuntimeError):
    """Some cases did not stay within their bounds; the page says which and how."""


@flow(name="stability", validate_parameters=True)
def stability(
    out: Path | None = None, areas: tuple[Area, ...] = (), quick_only: bool = False
) -> Summary:
    """Measure the cases of some areas, or of all, and write what came out.

    Args:
        out: new or empty folder, or one of an earlier stability run; by default one named after
            the run.
        areas: names of areas; none for all.
        quick_only: leave out the cases that train scenes.

    Raises:
        InputError: a folder that holds something else.
        CasesFailed: after everything is written, where a case failed.
    """
    named = [area for area in require_areas(areas) if cases_of(area, quick_only)]
    out = AllowedFolders.of_environment().to_write(out or folder_of_this_run(), "out")
    claim(out)
    rows = [row for area in named for row in check_stability(area, quick_only)]
    write_stability(rows, out)
    summary = summarise(rows)
    _show_in_prefect(rows, summary)
    if summary.failed:
        raise CasesFailed(str(summary))
    return summary


def claim(out: Path) -> None:
    """Raise InputError where the folder holds anything but an earlier stability run."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())) and not (out / TABLE).is_file():
        raise InputError(
            "--out must be new, empty, or of an earlier stability run",
            f"{out} with something else in it",
            "Choose another folder.",
        )


def _show_in_prefect(rows: list[StabilityRow], summary: Summary) -> None:
    """On the run's page: the value of each sweep that came nearest to its bound."""
    nearest: dict[tuple[str, str], StabilityRow] = {}
    for row in sorted(rows, key=lambda row: (not row.passed, -row.margin)):
        nearest[row.area, row.case] = row
    table = [
        {
            "area": row.area,
            "case": row.case,
            "at": row.value,
            "error": f"{row.error:.3g} {row.unit}",
            "bound": f"{row.bound:.3g} {row.unit}",
            "passed": row.passed,
        }
        for row in nearest.values()
    ]
    create_table_artifact(table, key="stability", description=str(summary))
