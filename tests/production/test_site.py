"""A site's state is remembered, and its processes see what they need and no more."""

from __future__ import annotations

import pytest

from flows.production.postgresql import find_programs
from flows.production.settings import BLOCK, FILE, KEPT, WORKER_VARIABLES, keep, kept, told
from flows.production.site import AUTHENTICATION, Database, Site
from flows.production.up import bring_up
from mocoflow_core.errors import InputError


def test_a_site_is_found_again_in_its_folder(tmp_path):
    assert Site.of_folder(tmp_path) is None
    site = Site(tmp_path, 4321, Database.POSTGRESQL)
    site.save()
    assert Site.of_folder(tmp_path) == site


def test_a_site_keeps_its_database_and_its_port(tmp_path):
    new = Site.asked_for(tmp_path)
    assert (new.port, new.database) == (4200, Database.SQLITE)
    made = Site.asked_for(tmp_path, 4321, Database.POSTGRESQL)
    made.save()
    assert Site.asked_for(tmp_path) == made
    assert Site.asked_for(tmp_path, 4321, Database.POSTGRESQL) == made
    assert Site.asked_for(tmp_path, port=4322) == Site(tmp_path, 4322, Database.POSTGRESQL)


def test_a_site_is_not_given_an_empty_database_in_place_of_its_own(tmp_path):
    Site(tmp_path, 4321, Database.POSTGRESQL).save()
    with pytest.raises(InputError, match=r"postgresql, in which .* keeps its runs, got sqlite"):
        Site.asked_for(tmp_path, database=Database.SQLITE)


def test_a_site_keeps_what_it_was_told_until_it_is_told_otherwise(tmp_path, monkeypatch):
    def up(**said):
        with monkeypatch.context() as once:
            for name in KEPT:
                once.delenv(name, raising=False)
            for name, value in said.items():
                once.setenv(name, value)
            found = Site(tmp_path).environment()
            keep(tmp_path, told(tmp_path))
        return found.get("MOCOFLOW_AIST_ROOT"), found.get(BLOCK)

    assert up() == (None, None)
    assert up(MOCOFLOW_AIST_ROOT="/sets/aist") == ("/sets/aist", None)
    assert up(MOCOFLOW_NOTIFICATION_BLOCK="slack-webhook/ops") == (
        "/sets/aist",
        "slack-webhook/ops",
    )
    assert up() == ("/sets/aist", "slack-webhook/ops")
    assert up(MOCOFLOW_AIST_ROOT="") == (None, "slack-webhook/ops")
    assert kept(tmp_path)[BLOCK] == "slack-webhook/ops"
    assert (tmp_path / FILE).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("content", ["", "{", "[]", '{"MOCOFLOW_STORE": 1}'])
def test_what_was_told_is_never_lost_silently(content, tmp_path):
    (tmp_path / FILE).write_text(content)
    with pytest.raises(InputError, match=f"{FILE} must be what the site was told"):
        Site(tmp_path).environment()


def test_what_is_told_is_written_to_no_place_that_a_link_leads_to(tmp_path):
    elsewhere = tmp_path / "precious"
    elsewhere.write_text("precious")
    (tmp_path / FILE).symlink_to(elsewhere)
    keep(tmp_path, {BLOCK: "slack-webhook/ops"})
    assert elsewhere.read_text() == "precious"
    assert kept(tmp_path) == {BLOCK: "slack-webhook/ops"}


@pytest.mark.parametrize(
    ("address", "ours"),
    [
        ("http://127.0.0.1:4321/api", True),
        ("http://localhost:4321/api/", True),
        ("http://127.0.0.1:4200/api", False),
        ("http://elsewhere:4321/api", False),
    ],
)
def test_a_site_is_known_by_its_address(address, ours, tmp_path):
    assert Site(tmp_path, 4321).is_at(address) == ours


@pytest.mark.parametrize("empty", ["", ":", "::"])
def test_an_empty_variable_lifts_no_confinement(empty, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    for name in WORKER_VARIABLES:
        monkeypatch.setenv(name, empty if name == "MOCOFLOW_DATA_ROOTS" else "")
    found = Site(tmp_path).environment()
    assert found["MOCOFLOW_DATA_ROOTS"] == str(tmp_path / "mocoflow" / "data")
    assert found["MOCOFLOW_RESULTS_ROOT"] == str(tmp_path / "mocoflow" / "results")
    assert not {"MOCOFLOW_STORE", "MOCOFLOW_AIST_ROOT"} & found.keys()


def test_a_relative_folder_is_the_same_for_a_worker_elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MOCOFLOW_AIST_ROOT", "sets/aist")
    monkeypatch.setenv("MOCOFLOW_DATA_ROOTS", "films::/mnt/films")
    monkeypatch.setenv("MOCOFLOW_STORE", "store")
    found = Site(tmp_path).environment()
    assert found["MOCOFLOW_AIST_ROOT"] == str(tmp_path / "sets" / "aist")
    assert found["MOCOFLOW_DATA_ROOTS"] == f"{tmp_path / 'films'}:/mnt/films"
    assert found["MOCOFLOW_STORE"] == str(tmp_path / "store")
    monkeypatch.setenv("MOCOFLOW_STORE", "s3://bucket/store")
    assert Site(tmp_path).environment()["MOCOFLOW_STORE"] == "s3://bucket/store"


def test_runs_are_confined_unless_the_user_has_said_where(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    for name in ("MOCOFLOW_DATA_ROOTS", "MOCOFLOW_RESULTS_ROOT"):
        monkeypatch.delenv(name, raising=False)
    found = Site(tmp_path).environment()
    assert found["MOCOFLOW_DATA_ROOTS"] == str(tmp_path / "mocoflow" / "data")
    assert found["MOCOFLOW_RESULTS_ROOT"] == str(tmp_path / "mocoflow" / "results")
    monkeypatch.setenv("MOCOFLOW_DATA_ROOTS", "/films")
    assert Site(tmp_path).environment()["MOCOFLOW_DATA_ROOTS"] == "/films"


def test_a_password_of_the_server_is_passed_on_to_its_clients(tmp_path, monkeypatch):
    monkeypatch.delenv(AUTHENTICATION, raising=False)
    assert "PREFECT_API_AUTH_STRING" not in Site(tmp_path).environment()
    monkeypatch.setenv(AUTHENTICATION, "me:secret")
    assert Site(tmp_path).environment()["PREFECT_API_AUTH_STRING"] == "me:secret"
    monkeypatch.setenv(AUTHENTICATION, "")
    assert not {AUTHENTICATION, "PREFECT_API_AUTH_STRING"} & Site(tmp_path).environment().keys()


def test_without_postgresql_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setattr("flows.production.postgresql.PLACES", ("/nowhere/*/bin",))
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(InputError, match="apt install postgresql"):
        find_programs()


@pytest.mark.parametrize("newest", ["9", "17"])
def test_data_are_opened_with_the_programs_that_made_them(newest, tmp_path, monkeypatch):
    for version in ("15", newest):
        folder = tmp_path / version / "bin"
        folder.mkdir(parents=True)
        for name in ("initdb", "pg_ctl", "postgres"):
            said = f"#!/bin/sh\necho 'postgres (PostgreSQL) {version}.4 (Debian {version}.4-1)'\n"
            (folder / name).write_text(said)
            (folder / name).chmod(0o755)
    monkeypatch.setattr("flows.production.postgresql.PLACES", (f"{tmp_path}/*/bin",))
    monkeypatch.setenv("PATH", "/bin:/usr/bin")
    monkeypatch.setattr("flows.production.postgresql.shutil.which", lambda _: None)
    assert find_programs("15") == tmp_path / "15" / "bin"
    assert find_programs() == tmp_path / str(max(15, int(newest))) / "bin"
    with pytest.raises(InputError, match="PostgreSQL 12's"):
        find_programs("12")


def test_a_running_site_is_not_changed_into_another_one(tmp_path, monkeypatch):
    Site(tmp_path, 4321).save()
    monkeypatch.setattr("flows.production.up.is_running", lambda *_: True)
    with pytest.raises(InputError, match="make down"):
        next(bring_up(Site(tmp_path, 4321, Database.POSTGRESQL)))


def test_a_running_worker_is_not_left_without_a_root_that_is_new(tmp_path, monkeypatch):
    site = Site(tmp_path, 4321)
    site.save()
    monkeypatch.delenv("MOCOFLOW_AIST_ROOT", raising=False)
    keep(tmp_path, told(tmp_path))
    monkeypatch.setattr("flows.production.deploy_site.is_running", lambda *_: True)
    monkeypatch.setenv("MOCOFLOW_AIST_ROOT", "/sets/aist")
    with pytest.raises(InputError, match=r"another MOCOFLOW_AIST_ROOT\. Take it down"):
        next(bring_up(site))
