"""Task check_stability: one area of the catalogue, measured afresh every time.

It is no cached stage: what it measures is the code itself, which stands in no key.
"""

from __future__ import annotations

from prefect import task
from prefect.cache_policies import NO_CACHE

from mocoflow_core.stability.catalogue import cases_of
from mocoflow_core.stability.measurement import measure_cases
from mocoflow_core.stability.table import StabilityRow
from tasks.progress import showing_progress


@task(
    name="check_stability",
    task_run_name="check_{area}",
    cache_policy=NO_CACHE,
    persist_result=False,
)
def check_stability(area: str, quick_only: bool) -> list[StabilityRow]:
    """Every value of every sweep of the area's cases. Seconds; minutes where scenes are trained."""
    with showing_progress(f"stability_{area}", lambda: None) as progress:
        return measure_cases(area, cases_of(area, quick_only), progress)
