"""Misplaced photographs of a benchmark's scenes, where its experiment asks for them."""

from __future__ import annotations

from typing import Any

from flows.benchmark_request import BenchmarkRequest
from flows.benchmark_scenes import AskedScene
from flows.reasons import reason_of
from mocoflow_core.report.omissions import Omission
from tasks.cancellation import RunCancelled
from tasks.misplace_views import misplace_views


def misplaced_scenes(request: BenchmarkRequest) -> tuple[list[dict[str, Any]], list[Omission]]:
    """What scores make of misplaced views of each scene, and the scenes that have none.

    Whatever goes wrong with one is its own failure and ends no other.
    """
    rows: list[dict[str, Any]] = []
    failures = []
    for scene in request.shifted_scenes:
        try:
            rows += _rows(request, scene)
        except RunCancelled:
            raise
        except Exception as error:
            failures.append(Omission(f"{scene.name}, misplaced views", reason_of(error)))
    return rows, failures


def _rows(request: BenchmarkRequest, scene: AskedScene) -> list[dict[str, Any]]:
    shown = request.shifted(scene)
    measured = misplace_views(
        *(request.store, shown.recording, shown.others, scene.name),
        *(shown.configuration.capture, shown.configuration.evaluation),
        shown.configuration.person_scores,
    )
    return list(measured.summary["rows"])
