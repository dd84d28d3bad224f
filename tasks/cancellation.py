"""Flow runs that are cancelled on Prefect's pages without a process of their own to be ended.

A cell of a benchmark runs inside the benchmark's process. Whoever cancels it alone sets its state;
its stages look at that now and then.
"""

from __future__ import annotations

from uuid import UUID

from prefect.client.orchestration import get_client
from prefect.context import TaskRunContext
from prefect.states import Cancelled

from tasks.server import if_the_server_answers


class RunCancelled(RuntimeError):
    """The flow run that this stage belongs to was cancelled."""


def end_if_cancelled() -> None:
    """Raise RunCancelled in a stage whose flow run was cancelled.

    A server that does not answer has told nothing.
    """
    context = TaskRunContext.get()
    run_id = context.task_run.flow_run_id if context else None
    if run_id is None:
        return
    with if_the_server_answers():
        if is_cancelled(run_id):
            raise RunCancelled("cancelled on Prefect's pages")


def is_cancelled(run_id: UUID) -> bool:
    """Whether a flow run was told to end, or has ended so."""
    state = get_client(sync_client=True).read_flow_run(run_id).state
    return state is not None and (state.is_cancelling() or state.is_cancelled())


def confirm_cancelled(run_id: UUID) -> None:
    """Say that a flow run has ended as it was told to."""
    state = Cancelled(message="Cancelled on Prefect's pages; what was computed is kept.")
    get_client(sync_client=True).set_flow_run_state(run_id, state, force=True)
