"""The schedule of a data set is active where its folder is, and nowhere else."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from flows.production.deploy import _set_schedules

ASKED = {
    "name": "aist",
    "entrypoint": "ours",
    "schedules": [{"slug": "nights", "cron": "0 1 * * 6", "timezone": "Etc/UTC", "active": False}],
}


class Client:
    """What of Prefect's client is asked for."""

    def __init__(self):
        self.active = None
        self.deleted = []

    def read_deployments(self):
        schedule = SimpleNamespace(id="schedule", slug="nights")
        former = SimpleNamespace(id="former", slug="weekly")
        theirs = SimpleNamespace(name="aist", entrypoint="theirs", schedules=[])
        ours = SimpleNamespace(
            name="aist", entrypoint="ours", id="aist", flow_id="flow", schedules=[former, schedule]
        )
        return [theirs, ours]

    def read_flow(self, _):
        return SimpleNamespace(name="benchmark")

    def delete_deployment_schedule(self, *ids):
        self.deleted.append(ids)

    def update_deployment_schedule(self, *_, active):
        self.active = active


@pytest.mark.parametrize(
    ("root", "state"),
    [
        (None, "paused: set MOCOFLOW_AIST_ROOT and deploy again"),
        ("", "paused: set MOCOFLOW_AIST_ROOT and deploy again"),
        ("missing", "paused: MOCOFLOW_AIST_ROOT is no folder"),
        (".", "runs"),
    ],
)
def test_a_schedule_is_active_where_its_data_are_and_says_what_it_waits_for(
    root, state, tmp_path, monkeypatch
):
    monkeypatch.delenv("MOCOFLOW_AIST_ROOT", raising=False)
    if root is not None:
        monkeypatch.setenv("MOCOFLOW_AIST_ROOT", root and str(tmp_path / root))
    client = Client()
    [said] = _set_schedules(client, ASKED)
    assert state in said
    assert client.active == (state == "runs")
    assert client.deleted == [("aist", "former")]
