"""Faults of the store and around it: one process each, as on a laptop."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from contextlib import contextmanager

import pytest

from mocoflow_core.io.run_folder import read_run
from tests.e2e.command import QUICK, done, ended, reconstruct, started
from tests.e2e.services import until
from tests.flows.stages import STAGES
from tests.object_storage import object_storage

pytestmark = pytest.mark.faults

DAY_S = 86400.0


def computed(run):
    return [stage.name for stage in read_run(run).stages if not stage.cached]


@pytest.fixture(scope="module")
def first(scene, tmp_path_factory):
    """A finished run and its store, to be copied before anything is broken."""
    root = tmp_path_factory.mktemp("first")
    done(*reconstruct(scene, root / "run", root / "store"))
    return root


@pytest.fixture
def store(first, tmp_path):
    return shutil.copytree(first / "store", tmp_path / "store")


def payload(store, stage):
    """The largest file of the only artifact of a stage."""
    files = (path for path in store.glob(f"{stage}/*/**/*") if path.suffix != ".json")
    return max((path for path in files if path.is_file()), key=lambda path: path.stat().st_size)


def deleted(path):
    path.unlink()


def flipped(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("damage", [deleted, flipped])
def test_a_damaged_payload_costs_its_stage_alone_and_is_named(scene, store, tmp_path, damage):
    broken = payload(store, "fit_motion")
    damage(broken)
    said = done("store", "verify", "--store", store, code=1)
    assert f"damaged fit_motion/{broken.relative_to(store / 'fit_motion').parts[0]}" in said
    done(*reconstruct(scene, tmp_path / "run", store))
    assert computed(tmp_path / "run") == ["fit_motion"]
    assert "Nothing is damaged." in done("store", "verify", "--store", store)


def test_of_two_runs_that_want_the_same_keys_one_computes_each(scene, tmp_path):
    runs = [tmp_path / "one", tmp_path / "two"]
    processes = [started(*reconstruct(scene, run, tmp_path / "store")) for run in runs]
    for process in processes:
        ended(process)
    made = [computed(run) for run in runs]
    assert sorted(made[0] + made[1]) == sorted(STAGES)


@contextmanager
def small_disk(folder, size):
    """A file system of so many bytes; skips where none may be mounted."""
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("no file system may be mounted here")
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def test_a_disk_that_fills_up_ends_the_run_and_more_space_lets_it_go_on(scene, tmp_path):
    disk = tmp_path / "disk"
    words = reconstruct(scene, tmp_path / "run", disk / "store")
    with small_disk(disk, 2_500_000):
        said = done(*words, code=2)
        assert "needs free space, got a full disk" in said
        assert len([line for line in said.splitlines() if line.startswith("mocoflow:")]) == 1
        kept = [path.parent.parent.name for path in disk.glob("store/*/*/manifest.json")]
        assert kept
        assert "Nothing is damaged." in done("store", "verify", "--store", disk / "store")
        subprocess.run(["mount", "-o", "remount,size=100000000", str(disk)], check=True)
        done(*words)
        assert sorted(computed(tmp_path / "run") + kept) == sorted(STAGES)


def cut_short(frame):
    frame.write_bytes(frame.read_bytes()[:100])


def dangling(frame):
    """What the system says of it is no bad input's line."""
    frame.unlink()
    frame.symlink_to("nowhere")


def test_scenes_that_fail_stop_no_other_and_are_named_with_their_reasons(scene, tmp_path):
    scenes, broken = [], {1: dangling, 3: cut_short}
    for number in range(5):
        folder = shutil.copytree(scene, tmp_path / f"scene{number}")
        description = json.loads((folder / "scene.json").read_text())
        (folder / "scene.json").write_text(json.dumps(description | {"name": f"scene{number}"}))
        scenes.append(folder)
    for number, damage in broken.items():
        damage(scenes[number] / "frames" / "cam00" / "000003.png")
    said = done(
        *("benchmark", "--scenes", *scenes, "--methods", "mocoflow", "--presets", "toy"),
        *("--seeds", "1", "--out", tmp_path / "out", "--store", tmp_path / "store", *QUICK),
    )
    record = json.loads((tmp_path / "out" / "benchmark.json").read_text())
    states = {cell["scene"]: cell["state"] for cell in record["cells"]}
    assert states == {f"scene{n}": "failed" if n in broken else "finished" for n in range(5)}
    pages = [(tmp_path / "out" / name).read_text() for name in ("benchmark.html", "table.md")]
    for number in broken:
        reason = record["cells"][number]["reason"]
        assert "000003.png" in reason
        assert f"scene{number}/toy/mocoflow/0 failed: {reason}" in said
        assert all(f"scene{number}" in page for page in pages)
        assert all(page.count("000003.png") >= len(broken) for page in pages)


@pytest.fixture(scope="module")
def storage():
    with object_storage() as made:
        yield made


def test_a_run_killed_while_it_uploads_is_finished_by_another_machine(scene, storage, tmp_path):
    """Object storage; machines are caches and states of their own."""
    url = "s3://killed/store"
    here, there = (
        storage.environment
        | {f"XDG_{kind}_HOME": str(tmp_path / name / kind) for kind in ("CACHE", "STATE")}
        for name in ("here", "there")
    )
    first = started(*reconstruct(scene, tmp_path / "run", url), environment=here)
    files = storage.files()

    def uploads():
        assert first.poll() is None
        return files.exists("killed") and files.glob("killed/store/fit_motion/*/*")

    until(uploads, 300.0, "fit_motion is uploaded", 0.02)
    first.kill()
    first.wait()
    assert "Nothing is damaged." in done("store", "verify", "--store", url, environment=here)
    before = {path.split("/")[2] for path in files.glob("killed/store/*/*/manifest.json")}

    done(*reconstruct(scene, tmp_path / "other", url), environment=there)
    assert set(computed(tmp_path / "other")) == set(STAGES) - before
    listed = done("store", "ls", "--store", url, environment=there)
    assert f"{len(STAGES)} artifacts" in listed.splitlines()[0]
    assert str(tmp_path / "other") in listed


BIG = """
import os, sys
from pathlib import Path
from mocoflow_core.artifacts import ClipArtifact
from mocoflow_core.io.remote_store import open_store
store = open_store("s3://multipart/store", Path(sys.argv[1]))
with store.computing(ClipArtifact, "0" * 40, resumes=False) as work:
    if not work.found:
        (work.path / "frames.npy").write_bytes(os.urandom(110_000_000))
        work.commit(1, {}, {}, {})
"""


def test_an_upload_of_many_parts_that_is_killed_is_never_seen_and_cleaned_up(storage, tmp_path):
    environment = storage.environment | {"PYTHONPATH": ".", "PATH": "/usr/bin:/bin"}
    words = [sys.executable, "-c", BIG, str(tmp_path / "mirror")]
    files = storage.files()
    files.mkdir("multipart")
    sender = subprocess.Popen(words, env=environment)
    until(lambda: files.list_multipart_uploads("multipart"), 120.0, "parts are sent", 0.005)
    sender.kill()
    sender.wait()
    assert files.find("multipart") == []

    url = ("--store", "s3://multipart/store")
    access = storage.environment | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    said = done("store", "verify", *url, environment=access)
    assert "left by an upload that was cut off" in said
    collect = ("store", "gc", *url, "--delete")
    for seconds_ago, options in ((600.0, ("--older-than", 0)), (6 * DAY_S, ())):
        with storage.uploads_begun(seconds_ago):
            done(*collect, *options, environment=access)
        assert files.list_multipart_uploads("multipart")
    with storage.uploads_begun(8 * DAY_S):
        done(*collect, environment=access)
    assert files.list_multipart_uploads("multipart") == []
    subprocess.run(words, env=environment, check=True)  # The same machine uploads what it has.
    assert "Nothing is damaged." in done("store", "verify", *url, environment=access)
    assert [path.rpartition("/")[2] for path in files.find("multipart")][-1] == "manifest.json"
