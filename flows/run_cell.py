"""One cell of a benchmark: a flow run of its own, which may fail or be cancelled alone."""

from __future__ import annotations

from uuid import UUID

from prefect import State
from prefect.context import FlowRunContext
from prefect.exceptions import Abort

from flows.benchmark_request import Cell
from flows.reasons import reason_of
from flows.reconstruct import reconstruct
from flows.slots import held_slot
from mocoflow_core.io.run_folder import RunRecord, read_run
from mocoflow_core.methods.benchmark_folder import CellRecord
from tasks.cancellation import RunCancelled, confirm_cancelled
from tasks.terminal_bar import terminal_line

CANCELLED = "cancelled on Prefect's pages; the same benchmark again goes on from there"


def run_cell(cell: Cell, slots: str | None = None) -> CellRecord:
    """Run one cell as a flow run that carries its name, unless its folder is finished.

    Args:
        slots: a global concurrency limit that the run holds one slot of.
    """
    record, request, out = cell
    if record.state == "refused":
        return record
    terminal_line(record.name)
    if _is_finished(cell):
        return record.finished_as(read_run(out), out)
    started = _Started(record.name)
    try:
        with held_slot(slots):
            state = reconstruct.with_options(flow_run_name=started.name)(
                scene=request.scene_path,
                out=out,
                preset=request.preset,
                seed=request.seed,
                budget_s=request.budget_s,
                settings=request.settings,
                import_settings=request.import_settings,
                store=request.store_url,
                return_state=True,
            )
    except Abort:  # No stage begins in a run that is being cancelled.
        if started.run_id is None:
            raise
        return _cancelled(record, started.run_id)
    if state.is_completed():
        return record.finished_as(read_run(out), out)
    # A run that is being cancelled stays so until it is confirmed.
    error = state.result(raise_on_failure=False) if state.is_final() else None
    told = state.is_cancelling() or state.is_cancelled() or isinstance(error, RunCancelled)
    if told and started.run_id is not None:
        return _cancelled(record, started.run_id)
    return record.model_copy(update={"state": "failed", "reason": _reason(state, error)})


class _Started:
    """The name of a flow run; being asked for it tells which run it is."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.run_id: UUID | None = None

    def name(self) -> str:
        context = FlowRunContext.get()
        self.run_id = context.flow_run.id if context and context.flow_run else None
        return self._name


def _cancelled(record: CellRecord, run_id: UUID) -> CellRecord:
    confirm_cancelled(run_id)
    return record.model_copy(update={"state": "cancelled", "reason": CANCELLED})


def _reason(state: State[RunRecord], error: object) -> str:
    if isinstance(error, BaseException):
        return reason_of(error)
    return " ".join((state.message or str(state.name)).split())


def _is_finished(cell: Cell) -> bool:
    try:
        return cell.request.claim(cell.out).is_finished()
    except Exception:
        return False  # Its own flow run will say why.
