"""Flow runs inside a flow run that other processes work on: none of them may be left behind."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import (
    FlowRunFilter,
    FlowRunFilterName,
    FlowRunFilterParentFlowRunId,
    FlowRunFilterState,
    FlowRunFilterStateType,
)
from prefect.client.schemas.objects import TERMINAL_STATES, FlowRun
from prefect.context import FlowRunContext
from prefect.settings import PREFECT_API_URL, temporary_settings
from prefect.states import Cancelling, Crashed

# Stages look every few seconds whether their run was cancelled.
_PATIENCE_S = 20.0


@contextmanager
def none_left_behind() -> Iterator[None]:
    """Let other processes run flows inside this one.

    They find the server of this process, also where it is one that only lives as long. A run whose
    process died is shown as crashed in the end.
    """
    with get_client(sync_client=True) as client:
        address = str(client.api_url)
    with temporary_settings(updates={PREFECT_API_URL: address}):
        try:
            yield
        finally:
            crash_inner_runs()


def cancel_inner_runs() -> None:
    """Tell the runs inside this flow's, wherever they are, to end; wait a while until they have."""
    client, end = get_client(sync_client=True), time.monotonic() + _PATIENCE_S
    while (runs := _unfinished()) and time.monotonic() < end:
        for run in runs:
            if run.state is None or not run.state.is_cancelling():
                client.set_flow_run_state(run.id, Cancelling(), force=True)
        time.sleep(0.5)


def crash_inner_runs(name: str | None = None) -> None:
    """Show the runs inside this flow's that have not ended, or those of one name, as crashed.

    Nobody works on them any more: their processes died without a word.
    """
    state = Crashed(message="Its process died; another run of the same name may have gone on.")
    for run in _unfinished(name):
        get_client(sync_client=True).set_flow_run_state(run.id, state, force=True)


def _unfinished(name: str | None = None) -> list[FlowRun]:
    context = FlowRunContext.get()
    if context is None or context.flow_run is None:
        return []
    ended = FlowRunFilterStateType(not_any_=list(TERMINAL_STATES))
    inside = FlowRunFilter(
        parent_flow_run_id=FlowRunFilterParentFlowRunId(any_=[context.flow_run.id]),
        name=FlowRunFilterName(any_=[name]) if name else None,
        state=FlowRunFilterState(type=ended),
    )
    return get_client(sync_client=True).read_flow_runs(flow_run_filter=inside)
