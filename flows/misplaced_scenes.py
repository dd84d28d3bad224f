"""Misplaced photographs of a benchmark's scenes, where its experiment asks for them."""

from __future__ import annotations

from typing import Any

from flows.benchmark_request import BenchmarkRequest
from flows.request import Request
from flows.run_cell import reason_of
from mocoflow_core.methods.benchmark_folder import CellRecord
from tasks.misplace_views import misplace_views

METHOD = "misplaced_views"


def misplaced_scenes(request: BenchmarkRequest) -> tuple[list[dict[str, Any]], list[CellRecord]]:
    """What scores make of misplaced views of each scene, and the scenes that could not be read.

    Whatever goes wrong with one is its own failure and ends no other.
    """
    rows: list[dict[str, Any]] = []
    failures = []
    for name, shown in request.shifted_scenes():
        try:
            rows += _rows(request, name, shown)
        except Exception as error:
            failures.append(
                CellRecord(
                    scene=name,
                    preset=shown.preset,
                    method=METHOD,
                    seed=shown.seed,
                    folder="",
                    state="failed",
                    reason=reason_of(error),
                )
            )
    return rows, failures


def _rows(request: BenchmarkRequest, name: str, shown: Request) -> list[dict[str, Any]]:
    measured = misplace_views(
        *(request.store, shown.recording, shown.others, name),
        *(shown.configuration.capture, shown.configuration.evaluation),
        shown.configuration.person_scores,
    )
    return list(measured.summary["rows"])
