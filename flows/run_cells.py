"""The cells of a benchmark: one after the other, in several processes, or on a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterable

from flows.benchmark_request import Cell
from flows.cell_task import failed
from flows.process_workers import run_in_processes
from flows.run_cell import run_cell
from flows.slots import require_slots
from flows.workers import Workers
from mocoflow_core.methods.benchmark_folder import CellRecord


def run_cells(cells: Iterable[Cell], workers: Workers) -> tuple[CellRecord, ...]:
    """Run all cells; the records come in the cells' order, wherever each one ran.

    Raises InputError for slots or a cluster that are not there.
    """
    if workers.dask is not None:
        # An extra, which others need not have.
        from flows.dask_workers import run_on_dask

        return run_on_dask(cells, workers.dask, workers.slots)
    if workers.slots:
        require_slots(workers.slots)
    if workers.count == 1:
        return tuple(_run_here(cell, workers.slots) for cell in cells)
    return run_in_processes(cells, workers.count, workers.slots)


def _run_here(cell: Cell, slots: str | None) -> CellRecord:
    """Whatever goes wrong is this cell's failure; only what ends the process ends the others."""
    try:
        return run_cell(cell, slots)
    except Exception as error:
        return failed(cell, error)
