"""A cell in another process than the benchmark, and what is said of one that got lost there."""

from __future__ import annotations

from prefect import task
from prefect.cache_policies import NO_CACHE

from flows.benchmark_request import Cell
from flows.reasons import reason_of
from flows.run_cell import run_cell
from mocoflow_core.io.run_folder import RUN
from mocoflow_core.methods.benchmark_folder import CellRecord
from tasks.inner_runs import crash_inner_runs

NAME = "cell"


@task(name=NAME, task_run_name="{cell.record.name}", cache_policy=NO_CACHE, persist_result=False)
def cell_in_process(cell: Cell, slots: str | None) -> CellRecord:
    """Run one cell in a worker process; its flow run appears inside the benchmark's."""
    return run_cell_again(cell, slots)


def run_cell_again(cell: Cell, slots: str | None) -> CellRecord:
    """Run a cell that another process may have begun and not ended."""
    crash_inner_runs(cell.record.name)
    return run_cell(cell, slots)


def lost(cell: Cell, why: str) -> CellRecord:
    """The record of a cell that nobody can tell about."""
    return cell.record.model_copy(update={"state": "failed", "reason": why})


def failed(cell: Cell, error: Exception) -> CellRecord:
    """The record of a cell that ended with an error of its own."""
    return lost(cell, reason_of(error))


def seen_from_here(cell: Cell, record: CellRecord) -> CellRecord:
    """The record, unless the cell's results lie where this process cannot read them."""
    if record.state == "finished" and not (cell.out / RUN).is_file():
        return lost(cell, f"its worker wrote {cell.out} on a disk that is not shared with this one")
    return record
