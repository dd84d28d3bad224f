"""A flow run whose state says that it is to end, while one of its stages works."""

from __future__ import annotations

import pytest
from prefect import flow, task
from prefect.client.orchestration import get_client
from prefect.context import FlowRunContext
from prefect.states import Cancelling

from tasks import progress
from tasks.cancellation import RunCancelled, confirm_cancelled, end_if_cancelled, is_cancelled


def cancel(run_id):
    get_client(sync_client=True).set_flow_run_state(run_id, Cancelling(), force=True)


def test_a_stage_ends_when_its_run_is_cancelled_and_not_before(prefect_server, monkeypatch):
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_UPDATES", 0.0)
    done = []

    @task
    def stage(run_id):
        with (
            pytest.raises(RunCancelled, match="Prefect's pages"),
            progress.showing_progress("optimise_scene", lambda: None) as report,
        ):
            report(0.1, "step 1")
            done.append("step 1")
            cancel(run_id)
            report(0.2, "step 2")
            done.append("step 2")
        raise RunCancelled

    @flow
    def run():
        stage(FlowRunContext.get().flow_run.id)

    state = run(return_state=True)
    assert done == ["step 1"]
    assert state.is_cancelling()
    run_id = state.state_details.flow_run_id
    confirm_cancelled(run_id)
    assert is_cancelled(run_id)
    assert get_client(sync_client=True).read_flow_run(run_id).state.is_cancelled()


def test_a_server_that_is_away_ends_nothing(prefect_server):
    from prefect.settings import PREFECT_API_URL, PREFECT_CLIENT_MAX_RETRIES, temporary_settings

    nobody = {PREFECT_API_URL: "http://127.0.0.1:9/api", PREFECT_CLIENT_MAX_RETRIES: 0}

    @task
    def stage():
        with temporary_settings(updates=nobody):
            end_if_cancelled()
        return True

    assert flow(stage.fn)() is True  # Outside of a task there is nothing to ask.
    assert flow(lambda: stage())() is True


@pytest.mark.parametrize("state", [None, Cancelling()])
def test_only_a_state_of_cancelling_is_one(prefect_server, state):
    @flow
    def run():
        return FlowRunContext.get().flow_run.id

    run_id = run()
    if state:
        get_client(sync_client=True).set_flow_run_state(run_id, state, force=True)
    assert is_cancelled(run_id) == bool(state)
