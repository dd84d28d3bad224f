"""A site with a password, taken down and brought up again: database, runs and queue are kept."""

from __future__ import annotations

from dataclasses import replace

import pytest

from flows.production.api import answers
from flows.production.processes import is_running
from flows.production.site import AUTHENTICATION
from flows.production.up import RUNS_AT_ONCE
from tests.e2e.production import available_database, production, site_command

pytestmark = pytest.mark.faults


@pytest.fixture(scope="module", params=[available_database()], ids=str)
def guarded(request, tmp_path_factory):
    files = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(AUTHENTICATION, "me:a long secret")
        with production(tmp_path_factory.mktemp("guarded"), files, request.param) as made:
            yield made


@pytest.fixture
def start(guarded, scene, tmp_path):
    """Start a run that would go on for hours."""

    def start(name):
        return guarded.start(
            "mocoflow/full",
            scene=str(scene),
            out=str(tmp_path / name),
            store=str(tmp_path / f"{name} store"),
            preset="toy",
            settings=["schedule.coarse_steps=1000000"],
        )

    return start


def test_what_waits_when_a_site_is_taken_down_runs_when_it_is_up_again(guarded, start):
    runs = [start(f"run {i}") for i in range(RUNS_AT_ONCE)]
    for run in runs:
        guarded.wait(run, "RUNNING", within_s=120.0)
    waits = start("waits")
    said = site_command(guarded, guarded.site, "down")
    assert f"{RUNS_AT_ONCE} runs cancelled" in said
    # Neither port nor database is said again.
    site_command(guarded, guarded.site, "up")
    assert {guarded.state(run) for run in runs} == {"CANCELLED"}
    guarded.wait(waits, "RUNNING", within_s=120.0)
    assert guarded.ask(f"/flow_runs/{waits}")["run_count"] == 1


def test_without_the_password_a_site_is_not_brought_up_again_but_taken_down(guarded):
    secrets = (AUTHENTICATION, "PREFECT_API_AUTH_STRING")
    kept = {name: value for name, value in guarded.environment.items() if name not in secrets}
    without = replace(guarded, environment=kept)
    with pytest.raises(AssertionError, match=f"{AUTHENTICATION} that the running server has"):
        site_command(without, guarded.site, "up")
    assert is_running(guarded.site, "worker")
    said = site_command(without, guarded.site, "down")
    assert "without being cancelled: HTTP Error 401" in said
    assert "worker stopped" in said
    assert not is_running(guarded.site, "worker")
    assert not answers(guarded.url)
