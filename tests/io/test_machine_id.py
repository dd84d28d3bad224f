"""Which machine this is, whatever it is called."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from mocoflow_core.io import machine
from mocoflow_core.io.machine import machine_id


def test_an_id_is_made_once(tmp_path):
    file = tmp_path / "state" / "machine-id"
    assert machine_id(file) == machine_id(file)
    assert machine_id(tmp_path / "other") != machine_id(file)


def test_who_asks_first_at_the_same_time_gets_the_same(tmp_path):
    with ThreadPoolExecutor(8) as threads:
        assert len(set(threads.map(machine_id, [tmp_path / "machine-id"] * 8))) == 1


def test_machines_that_share_their_users_folders_differ_by_the_systems_own_id(
    tmp_path, monkeypatch
):
    told = []
    for name in ("one", "two"):
        (tmp_path / name).write_text(f"{name}\n")
        monkeypatch.setattr(machine, "_SYSTEMS_OWN", tmp_path / name)
        told.append(machine_id(tmp_path / "machine-id"))
    assert len(set(told)) == 2


def test_a_system_without_an_id_has_the_users(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "_SYSTEMS_OWN", tmp_path / "missing")
    assert machine_id(tmp_path / "machine-id") == machine_id(tmp_path / "machine-id")


def test_an_empty_file_is_none(tmp_path):
    (tmp_path / "machine-id").touch()
    machine_id(tmp_path / "machine-id")
    assert (tmp_path / "machine-id").read_text().strip()


def test_where_nothing_can_be_kept_the_id_is_nobodys(tmp_path):
    (tmp_path / "file").touch()
    assert machine_id(tmp_path / "file" / "id") != machine_id(tmp_path / "file" / "id")
