"""What ``deploy`` needs is asked for in one line: a server, a place for the store."""

from __future__ import annotations

import subprocess

import pytest

from flows.allowed_folders import STORE
from flows.production.__main__ import _site_meant
from flows.production.automations import make_automation, make_notifications
from flows.production.deploy_site import deploy_site
from flows.production.settings import BLOCK, KEPT, keep, kept
from flows.production.site import MARK, Site
from flows.production.stores import make_store
from mocoflow_core.errors import InputError
from tests.free_port import free_port

TOLD = {BLOCK: "slack-webhook/ops", STORE: "s3://bucket/store"}
CONTENT = {
    "name": "tell",
    "trigger": {"type": "event", "posture": "Reactive", "expect": ["failed"], "within": 0},
    "actions": [{"type": "send-notification", "subject": "s", "body": "b"}],
}


@pytest.fixture
def site(tmp_path, monkeypatch):
    """One that was told a block and a store, in an environment that says nothing."""
    for name in (*KEPT, MARK, "PREFECT_API_URL"):
        monkeypatch.delenv(name, raising=False)
    made = Site(tmp_path, 4321)
    made.save()
    keep(tmp_path, TOLD)
    return made


def test_without_a_site_or_a_server_nothing_is_deployed_anywhere(site, tmp_path):
    with pytest.raises(InputError, match="export PREFECT_API_URL"):
        _site_meant(tmp_path / "elsewhere")


@pytest.mark.parametrize("server", [None, "", "http://127.0.0.1:4321/api"])
def test_without_another_server_the_machines_site_is_meant(server, site, monkeypatch):
    if server is not None:
        monkeypatch.setenv("PREFECT_API_URL", server)
    assert _site_meant(site.folder) == site


def test_another_server_is_told_by_the_environment_alone(site, monkeypatch):
    monkeypatch.setenv("PREFECT_API_URL", "http://elsewhere:4200/api")
    assert _site_meant(site.folder) is None


def test_a_process_of_the_site_has_all_that_the_site_was_told(site, monkeypatch):
    monkeypatch.setenv(MARK, str(site.folder))
    assert _site_meant(site.folder) is None


@pytest.fixture
def deploying(monkeypatch):
    """The environments of deploying processes, which end with a code."""
    seen: list[dict[str, str]] = []

    def run(words, env):
        seen.append(env)
        return subprocess.CompletedProcess(words, int(env.get(STORE) == "s4://typo"))

    monkeypatch.setattr("flows.production.deploy_site.subprocess.run", run)
    return seen


def test_a_site_is_deployed_with_what_it_was_told_before_and_keeps_what_is_new(
    site, deploying, monkeypatch
):
    monkeypatch.setenv(BLOCK, "email/ops")
    deploy_site(site)
    assert (deploying[0][BLOCK], deploying[0][STORE]) == ("email/ops", TOLD[STORE])
    assert kept(site.folder) == TOLD | {BLOCK: "email/ops"}


def test_what_cannot_be_deployed_is_not_kept(site, deploying, monkeypatch):
    monkeypatch.setenv(STORE, "s4://typo")
    with pytest.raises(RuntimeError, match="written above"):
        deploy_site(site)
    assert kept(site.folder) == TOLD


def test_a_running_worker_is_not_left_without_a_root_that_is_deployed(site, deploying, monkeypatch):
    monkeypatch.setattr("flows.production.deploy_site.is_running", lambda *_: True)
    monkeypatch.setenv("MOCOFLOW_AIST_ROOT", "/sets/aist")
    with pytest.raises(InputError, match="another MOCOFLOW_AIST_ROOT"):
        deploy_site(site)
    assert not deploying


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


def test_a_server_that_is_not_there_is_named(prefect_server, monkeypatch):
    from prefect.settings import PREFECT_API_URL, PREFECT_CLIENT_MAX_RETRIES, temporary_settings

    from flows.production.deploy import deploy

    monkeypatch.delenv(STORE, raising=False)
    nobody = {PREFECT_API_URL: f"http://127.0.0.1:{free_port()}/api", PREFECT_CLIENT_MAX_RETRIES: 0}
    with temporary_settings(nobody), pytest.raises(InputError, match="a server that answers at"):
        deploy()


def test_a_block_that_is_not_there_leaves_those_who_are_told_as_they_are(
    prefect_server, monkeypatch
):
    from prefect.client.orchestration import get_client

    named = {"automations": {"name": {"any_": [CONTENT["name"]]}}}
    with get_client(sync_client=True) as client:

        def told(block: str | None) -> tuple[str, int]:
            monkeypatch.setenv(BLOCK, block or "")
            said = make_notifications(client, [CONTENT])
            return said, len(client.request("POST", "/automations/filter", json=named).json())

        make_automation(client, {**CONTENT, "actions": [{"type": "do-nothing"}]})
        said, automations = told("slack-webhook/opps")
        assert "slack-webhook/opps, and the server has no such block" in said
        assert automations == 1
        said, automations = told(None)
        assert said.startswith("nobody is told")
        assert automations == 0
