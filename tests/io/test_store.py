from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from mocoflow_core.artifacts import ClipArtifact
from mocoflow_core.errors import InputError
from mocoflow_core.io.remote_store import open_store
from mocoflow_core.io.store import Store

KEY = "0" * 40


@pytest.fixture(params=["folder", "object store"])
def store(request, tmp_path) -> Store:
    if request.param == "folder":
        return Store(tmp_path / "store")
    return open_store(f"memory://{tmp_path.name}", tmp_path / "mirrors")


def compute(store: Store, content: bytes = b"frames", resumes: bool = False) -> ClipArtifact:
    with store.computing(ClipArtifact, KEY, resumes=resumes) as work:
        if work.found:
            return work.found
        (work.path / "part").mkdir(exist_ok=True)
        (work.path / "part" / "frames.npy").write_bytes(content)
        return work.commit(1, {"scene": "aa"}, {"fps": 12.0}, {"frames": 3})


def payload(store: Store, artifact: ClipArtifact) -> Path:
    return store.folder(artifact) / "part" / "frames.npy"


def in_another_process(store: Store, body: str) -> subprocess.Popen:
    script = f"""
import os, time, signal
from pathlib import Path
from mocoflow_core.artifacts import ClipArtifact
from mocoflow_core.io.store import Store
store, key = Store(Path({str(store.root)!r})), {KEY!r}
"""
    return subprocess.Popen(
        [sys.executable, "-c", script + textwrap.dedent(body)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
    )


def test_an_absent_artifact_is_a_miss(store):
    assert store.find(ClipArtifact, KEY) is None


def test_a_committed_artifact_is_found_as_it_was_written(store):
    made = compute(store)
    found = store.find(ClipArtifact, KEY)
    assert found == made.model_copy(update={"cached": True})
    assert found.summary == {"frames": 3}
    assert payload(store, found).read_bytes() == b"frames"


def test_computing_what_is_there_finds_it(store):
    compute(store, b"first")
    assert payload(store, compute(store, b"second")).read_bytes() == b"first"


def test_a_deleted_payload_is_rebuilt(tmp_path):
    store = Store(tmp_path)
    payload(store, compute(store)).unlink()
    assert store.find(ClipArtifact, KEY) is None
    assert payload(store, compute(store)).read_bytes() == b"frames"


def test_a_flipped_byte_is_rebuilt(tmp_path):
    store = Store(tmp_path)
    payload(store, compute(store)).write_bytes(b"framez")
    assert store.find(ClipArtifact, KEY) is None
    assert payload(store, compute(store)).read_bytes() == b"frames"


def test_a_damaged_manifest_is_rebuilt(tmp_path):
    store = Store(tmp_path)
    (store.folder(compute(store)) / "manifest.json").write_text('{"stage": ')
    assert store.find(ClipArtifact, KEY) is None
    assert not compute(store).cached


def test_a_moved_store_keeps_its_artifacts(tmp_path):
    compute(Store(tmp_path / "here"))
    (tmp_path / "here").rename(tmp_path / "there")
    assert Store(tmp_path / "there").find(ClipArtifact, KEY)


def test_an_unknown_address_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="nosuch"):
        open_store("nosuch://bucket", tmp_path)


def test_a_failed_stage_leaves_nothing_that_is_taken_for_whole(store):
    with pytest.raises(ZeroDivisionError), store.computing(ClipArtifact, KEY, resumes=False) as w:
        (w.path / "frames.npy").write_bytes(b"half")
        _ = 1 / 0
    assert store.find(ClipArtifact, KEY) is None
    assert not (store.folder(compute(store)) / "frames.npy").exists()


def test_a_process_killed_before_the_rename_leaves_a_miss_and_its_checkpoint(tmp_path):
    store = Store(tmp_path)
    dying = in_another_process(
        store,
        """
        with store.computing(ClipArtifact, key, resumes=True) as work:
            (work.path / "checkpoint").write_text("step 7")
            (work.path / "manifest.json").write_text("{}")
            work.note_time()
            os.kill(os.getpid(), signal.SIGKILL)
        """,
    )
    assert dying.wait(timeout=30) == -signal.SIGKILL
    assert store.find(ClipArtifact, KEY) is None
    with store.computing(ClipArtifact, KEY, resumes=True) as work:
        assert (work.path / "checkpoint").read_text() == "step 7"
        artifact = work.commit(1, {}, {}, {})
    assert artifact.wall_s > 0
    assert store.find(ClipArtifact, KEY)


def test_a_stage_that_does_not_resume_starts_with_an_empty_workspace(tmp_path):
    store = Store(tmp_path)
    with pytest.raises(KeyError), store.computing(ClipArtifact, KEY, resumes=False) as work:
        (work.path / "old").touch()
        raise KeyError
    with store.computing(ClipArtifact, KEY, resumes=False) as work:
        assert list(work.path.iterdir()) == []


def test_of_two_processes_that_want_one_key_one_computes_and_the_other_waits(tmp_path):
    store = Store(tmp_path)
    body = """
    with store.computing(ClipArtifact, key, resumes=False) as work:
        if work.found:
            print("found")
        else:
            time.sleep(0.5)
            (work.path / "by").write_text("me")
            work.commit(1, {}, {}, {})
            print("computed")
    """
    processes = [in_another_process(store, body) for _ in range(3)]
    said = sorted(process.communicate(timeout=60)[0].strip() for process in processes)
    assert said == ["computed", "found", "found"]


def test_the_lock_of_a_killed_process_is_free_at_once(tmp_path):
    store = Store(tmp_path)
    holder = in_another_process(
        store,
        """
        with store.computing(ClipArtifact, key, resumes=False):
            print("holds", flush=True)
            time.sleep(60)
        """,
    )
    assert holder.stdout.readline() == "holds\n"
    os.kill(holder.pid, signal.SIGKILL)
    holder.wait()
    assert not compute(store).cached


def test_a_full_disk_is_one_line_of_bad_input_and_no_artifact(tmp_path):
    store = Store(tmp_path)
    with (
        pytest.raises(InputError, match="full disk"),
        store.computing(ClipArtifact, KEY, resumes=False) as work,
        Path("/dev/full").open("wb", buffering=0) as full,
    ):
        (work.path / "frames.npy").write_bytes(b"half")
        full.write(b"the other half")
    assert store.find(ClipArtifact, KEY) is None


def test_a_full_disk_that_a_library_reports_in_words_is_recognised(tmp_path):
    store = Store(tmp_path)
    with (
        pytest.raises(InputError, match="full disk"),
        store.computing(ClipArtifact, KEY, resumes=False),
    ):
        raise RuntimeError("cannot write: No space left on device (os error 28)")


def test_copies_of_the_store_are_verified_too(tmp_path):
    artifact = compute(Store(tmp_path / "one"))
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    copy = Store(tmp_path / "two")
    payload(copy, artifact).write_bytes(b"")
    assert copy.find(ClipArtifact, KEY) is None
