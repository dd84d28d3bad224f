"""The event that tells a Prefect server of a benchmark that has become worse or slower."""

from __future__ import annotations

from pathlib import Path

from prefect.events import emit_event
from prefect.runtime import flow_run

from mocoflow_core.methods.benchmark_folder import BenchmarkRecord
from mocoflow_core.report.markdown_text import plain

# What deployments/notifications.yaml waits for.
EVENT = "mocoflow.benchmark.regressed"


def tell_of_regressions(record: BenchmarkRecord, page: Path) -> None:
    """Emit the event where something is worse than usual, with what and why as text."""
    if not record.regressions:
        return
    name = page.resolve().parent.name
    worse = [f"{plain(str(row['what']))}: {plain(str(row['why']))}" for row in record.regressions]
    run = {
        "prefect.resource.id": f"prefect.flow-run.{flow_run.id}",
        "prefect.resource.role": "flow-run",
    }
    emit_event(
        event=EVENT,
        resource={
            "prefect.resource.id": f"mocoflow.benchmark.{name}",
            "prefect.resource.name": name,
        },
        related=[run],
        payload={"text": "\n".join(worse), "page": str(page), "command": record.command},
    )
