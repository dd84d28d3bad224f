"""Task write_stability: the table, the sweep plots and the page of a stability run."""

from __future__ import annotations

from pathlib import Path

from prefect import task
from prefect.cache_policies import NO_CACHE

from mocoflow_core.io.machine import describe_machine
from mocoflow_core.report import stability_page
from mocoflow_core.stability.table import StabilityRow


@task(name="write_stability", cache_policy=NO_CACHE, persist_result=False)
def write_stability(rows: list[StabilityRow], out: Path) -> None:
    """Output: ``stability.parquet``, ``plots/<area>.png``, ``stability.html``. A few seconds."""
    stability_page.write_stability(rows, describe_machine(), out)
