"""What ``deploy`` needs is asked for in one line: a server, a place for the store."""

from __future__ import annotations

import pytest

from flows.production.__main__ import _site_or_server
from flows.production.automations import make_notifications
from flows.production.settings import BLOCK, keep
from flows.production.site import Site
from flows.production.stores import make_store
from mocoflow_core.errors import InputError

CONTENT = {"name": "tell", "actions": [{"type": "send-notification", "subject": "s", "body": "b"}]}


def test_without_a_site_or_a_server_nothing_is_deployed_anywhere(tmp_path, monkeypatch):
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    with pytest.raises(InputError, match="export PREFECT_API_URL"):
        _site_or_server(tmp_path)


@pytest.mark.parametrize("server", [None, "", "http://127.0.0.1:4321/api"])
def test_what_a_site_was_told_holds_for_its_deployments_too(server, tmp_path, monkeypatch):
    monkeypatch.delenv(BLOCK, raising=False)
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    if server is not None:
        monkeypatch.setenv("PREFECT_API_URL", server)
    site = Site(tmp_path, 4321)
    site.save()
    keep(tmp_path, {BLOCK: "slack-webhook/ops"})
    found = _site_or_server(tmp_path)
    assert (found["PREFECT_API_URL"], found[BLOCK]) == (site.api, "slack-webhook/ops")


def test_another_server_is_told_by_the_environment_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("PREFECT_API_URL", "http://elsewhere:4200/api")
    Site(tmp_path, 4321).save()
    assert _site_or_server(tmp_path) == {}


@pytest.mark.parametrize("address", ["bogus://bucket", "/dev/null/store", "/proc/nobody/store"])
def test_a_store_that_cannot_be_made_is_bad_input(address, monkeypatch):
    monkeypatch.setenv("MOCOFLOW_STORE", address)
    monkeypatch.setattr("mocoflow_core.io.retry.WAITS_S", ())
    with pytest.raises(InputError, match=address):
        make_store()


def test_the_folder_of_a_store_is_made(tmp_path, monkeypatch):
    monkeypatch.setenv("MOCOFLOW_STORE", str(tmp_path / "a" / "store"))
    make_store()
    assert (tmp_path / "a" / "store").is_dir()


@pytest.mark.parametrize(
    ("named", "why"),
    [(None, "set one, deploy again"), ("slack-webhook/opps", "slack-webhook/opps is no block")],
)
def test_without_its_block_nobody_is_told_and_that_is_said(prefect_server, named, why, monkeypatch):
    from prefect.client.orchestration import get_client

    monkeypatch.delenv(BLOCK, raising=False)
    if named:
        monkeypatch.setenv(BLOCK, named)
    with get_client(sync_client=True) as client:
        said = make_notifications(client, [CONTENT])
    assert said.startswith("nobody is told")
    assert why in said
