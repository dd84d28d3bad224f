"""The commands mocoflow store ls, verify and gc, on a store with a run that is kept and one not."""

from __future__ import annotations

import json
import shutil

import pytest
from typer.testing import CliRunner

from flows.command_line import app
from flows.user_folders import this_machine
from flows.users_store import open_users_store
from mocoflow_core.artifacts import ClipArtifact, PlanArtifact
from mocoflow_core.errors import InputError
from mocoflow_core.io.holdings import FolderHoldings
from mocoflow_core.io.known_runs import KnownRun
from mocoflow_core.io.manifest import MANIFEST
from mocoflow_core.io.remote_store import file_system
from mocoflow_core.io.run_folder import RunFolder, RunRecord, StageRecord
from mocoflow_core.io.store import Store

CLIP, PLAN = f"extract_clip/{'0' * 40}", f"plan_scene/{'1' * 40}"


def said(*words, code=0):
    result = CliRunner().invoke(app, ["store", *map(str, words)])
    assert result.exit_code == code, result.output
    return result.output


def compute(store, kind, name):
    with store.computing(kind, name.partition("/")[2], resumes=False) as work:
        (work.path / "payload").write_bytes(1000 * b"x")
        work.commit(1, {}, {}, {})


@pytest.fixture
def store(tmp_path):
    """Its clip is needed by a run, its plan by none."""
    made = Store(tmp_path / "store")
    compute(made, PlanArtifact, PLAN)
    begun = RunRecord(
        request="a", scene="s", scene_path="", preset="toy", seed=0, configuration={}, store=""
    )
    RunFolder.claim(tmp_path / "run", begun)
    made.serve(tmp_path / "run", this_machine())
    compute(made, ClipArtifact, CLIP)
    return made


def test_ls_tells_who_needs_what(store, tmp_path):
    lines = {line.split()[0]: line for line in said("ls", "--store", store.url).splitlines()}
    assert str(tmp_path / "run") in lines[CLIP]
    assert "no run" in lines[PLAN]
    assert "2 artifacts" in lines[f"{store.url}:"]


def test_ls_of_an_empty_store_is_one_line(tmp_path):
    assert said("ls", "--store", tmp_path).splitlines() == [f"{tmp_path}: 0 artifacts, 0 B"]


def test_verify_names_what_is_damaged_and_fails(store):
    assert "Nothing is damaged." in said("verify", "--store", store.url)
    (store.root / CLIP / "payload").write_bytes(1000 * b"y")
    output = said("verify", "--store", store.url, code=1)
    assert f"damaged {CLIP}: payload has changed since it was written" in output
    assert PLAN not in output


def test_verify_removes_what_is_damaged_where_it_is_told_to(store):
    (store.root / CLIP / "payload").write_bytes(1000 * b"y")
    assert "--remove" in said("verify", "--store", store.url, code=1)
    assert "1 removed" in said("verify", "--store", store.url, "--remove", code=1)
    assert "Nothing is damaged." in said("verify", "--store", store.url)
    assert (store.root / PLAN).is_dir()
    assert not (store.root / CLIP).exists()


def test_what_was_damaged_there_is_uploaded_again_by_the_machine_that_holds_it(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    url = f"memory://{tmp_path.name}"
    there = open_users_store(url)
    compute(there, ClipArtifact, CLIP)
    files, base = file_system(url)
    [payload] = [path for path in files.find(base) if not path.endswith(MANIFEST)]
    whole = files.cat_file(payload)
    files.pipe_file(payload, whole[:-1] + b"y")
    there.find(ClipArtifact, CLIP.partition("/")[2])
    assert "1 damaged" in said("verify", "--store", url, code=1)
    assert "1 removed" in said("verify", "--store", url, "--remove", code=1)
    there.find(ClipArtifact, CLIP.partition("/")[2])
    assert files.cat_file(payload) == whole
    assert "Nothing is damaged." in said("verify", "--store", url)


def test_verify_names_leftovers_without_failing(store):
    (store.root / f"{PLAN}.partial").mkdir()
    output = said("verify", "--store", store.url)
    assert f"leftover {PLAN}: left by a try that was killed" in output


def test_gc_says_what_can_go_and_removes_nothing(store):
    output = said("gc", "--store", store.url, "--older-than", 0)
    assert "can go: add --delete." in output
    assert f"goes  {PLAN}" in output
    assert f"goes  {CLIP}" not in output
    assert (store.root / PLAN).is_dir()


def test_gc_removes_with_delete_what_no_run_needs(store):
    assert "freed" in said("gc", "--store", store.url, "--older-than", 0, "--delete")
    assert not (store.root / PLAN).exists()
    assert store.find(ClipArtifact, CLIP.partition("/")[2])


def used(store, folder, *names):
    """Written down by a run of this machine whose folder is there."""
    folder.mkdir(exist_ok=True)
    (folder / "run.json").write_text("{}")
    store.write_run(KnownRun.here(folder, this_machine()).using(names))


def test_gc_keeps_what_a_run_made_while_it_began(store, tmp_path, monkeypatch):
    """Its record is younger than the first look at the records."""
    look = FolderHoldings.look

    def begun_meanwhile(place):
        used(store, tmp_path / "late", PLAN)
        return look(place)

    monkeypatch.setattr(FolderHoldings, "look", begun_meanwhile)
    assert "0 B freed." in said("gc", "--store", store.url, "--older-than", 0, "--delete")
    assert (store.root / PLAN).is_dir()


def test_gc_keeps_what_a_run_took_between_the_verdict_and_the_removal(store, tmp_path, monkeypatch):
    remove = FolderHoldings.remove

    def taken_meanwhile(place, *held):
        used(store, tmp_path / "late", PLAN)
        return remove(place, *held)

    monkeypatch.setattr(FolderHoldings, "remove", taken_meanwhile)
    output = said("gc", "--store", store.url, "--older-than", 0, "--delete")
    assert f"goes  {PLAN}" in output
    assert "0 B freed." in output
    assert store.find(PlanArtifact, PLAN.partition("/")[2])


@pytest.mark.parametrize("command", ["gc", "ls"])
def test_a_record_of_a_newer_version_ends_the_command_and_nothing_is_removed(store, command):
    record = next((store.root / "runs").iterdir())
    record.write_text(json.dumps({**json.loads(record.read_text()), "added_later": 1}))
    words = ["--older-than", "0", "--delete"] if command == "gc" else []
    result = CliRunner().invoke(app, ["store", command, "--store", store.url, *words])
    assert (store.root / CLIP).is_dir()
    assert (store.root / PLAN).is_dir()
    assert isinstance(result.exception, InputError)
    assert str(record) in str(result.exception)
    assert "remove the file" in result.exception.action


def test_of_two_machines_of_one_name_neither_removes_what_the_other_needs(
    store, tmp_path, monkeypatch
):
    shutil.rmtree(tmp_path / "run")  # As the other machine sees it.
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "another"))
    said("gc", "--store", store.url, "--older-than", 0, "--delete")
    assert (store.root / CLIP).is_dir()


def test_a_machine_that_got_another_name_knows_its_runs(store, tmp_path, monkeypatch):
    """As a container does that is made anew."""
    shutil.rmtree(tmp_path / "run")
    monkeypatch.setattr("socket.gethostname", lambda: "renamed")
    said("gc", "--store", store.url, "--older-than", 0, "--delete")
    assert not (store.root / CLIP).exists()


def test_gc_keeps_what_is_young(store):
    assert "0 B freed." in said("gc", "--store", store.url, "--delete")
    assert (store.root / PLAN).is_dir()


def test_a_run_that_was_removed_is_named_and_its_artifacts_go(store, tmp_path):
    shutil.rmtree(tmp_path / "run")
    output = said("gc", "--store", store.url, "--older-than", 0, "--delete")
    assert f"no longer there: the run in {tmp_path / 'run'}" in output
    assert said("ls", "--store", store.url).splitlines() == [f"{store.url}: 0 artifacts, 0 B"]
    assert list((store.root / "runs").iterdir()) == []


def test_a_moved_run_keeps_its_artifacts_where_it_is_named(store, tmp_path):
    folder = RunFolder(tmp_path / "run", RunRecord.model_validate_json(read(tmp_path / "run")))
    stage = StageRecord(name="extract_clip", key="0" * 40, wall_s=1.0, cpu_s=1.0, cached=False)
    folder.finish({"stages": (stage,)})
    (tmp_path / "run").rename(tmp_path / "moved")
    words = ("gc", "--store", store.url, "--older-than", 0, "--delete", "--runs")
    said(*words, tmp_path / "moved", tmp_path / "nothing")
    assert (store.root / CLIP).is_dir()


def read(run):
    return (run / "run.json").read_text()
