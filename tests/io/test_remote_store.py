"""Stores on object storage, against an S3 server on this machine."""

from __future__ import annotations

import json
import threading
import time

import pytest

from mocoflow_core.artifacts import ClipArtifact
from mocoflow_core.errors import InputError
from mocoflow_core.io import retry
from mocoflow_core.io.manifest import MANIFEST
from mocoflow_core.io.remote_store import RemoteStore, open_store

KEY = "0" * 40
PLACE = f"extract_clip/{KEY}"


@pytest.fixture
def files(reachable):
    """The storage as others see it."""
    return reachable.files()


@pytest.fixture
def shared(files, tmp_path):
    """Opens the same new store on as many machines as wanted."""

    def machine(name: str) -> RemoteStore:
        return open_store(f"s3://bucket/{tmp_path.name}", tmp_path / name)

    return machine


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(retry, "WAITS_S", (0.01,))


def compute(store, content=b"frames"):
    with store.computing(ClipArtifact, KEY, resumes=False) as work:
        if work.found:
            return work.found
        (work.path / "part").mkdir()
        (work.path / "part" / "frames.npy").write_bytes(content)
        (work.path / "masks.npy").write_bytes(content + b" of masks")
        return work.commit(1, {"scene": "aa"}, {"fps": 12.0}, {"frames": 3})


def content_of(store):
    return (store.folder(store.find(ClipArtifact, KEY)) / "part" / "frames.npy").read_bytes()


def objects(files, store):
    """The names of an artifact's objects, the manifest's last."""
    found = files.find(f"{store.url.removeprefix('s3://')}/{PLACE}")
    return sorted(found, key=lambda path: path.endswith(MANIFEST))


def test_another_machine_finds_what_was_uploaded(shared):
    compute(shared("one"))
    assert content_of(shared("two")) == b"frames"


def test_an_upload_without_its_manifest_is_a_miss(shared, files):
    compute(shared("one"))
    files.rm_file(objects(files, shared("one"))[-1])
    assert shared("two").find(ClipArtifact, KEY) is None


@pytest.mark.parametrize("damage", [b"framez", b"", None])
def test_a_payload_that_was_damaged_there_is_not_used_and_made_good(shared, files, damage):
    compute(shared("one"))
    for path in objects(files, shared("one"))[:-1]:
        files.rm_file(path) if damage is None else files.pipe_file(path, damage)
    assert shared("two").find(ClipArtifact, KEY) is None
    compute(shared("two"))
    assert content_of(shared("three")) == b"frames"


def test_what_only_the_mirror_holds_is_uploaded_when_it_is_found(shared, files):
    """As after a kill between the commit and the end of the upload."""
    compute(shared("one"))
    for path in objects(files, shared("one"))[1:]:
        files.rm_file(path)
    assert shared("one").find(ClipArtifact, KEY)
    assert content_of(shared("two")) == b"frames"


def test_two_machines_that_compute_one_key_leave_either_artifact_whole(shared, monkeypatch):
    """One is held up before its manifest until the other is done; their contents differ."""
    slow, fast, done = shared("slow"), shared("fast"), threading.Event()
    write = slow.files.write

    def late(path, content):
        done.wait(20.0)
        write(path, content)

    monkeypatch.setattr(slow.files, "write", late)
    other = threading.Thread(target=compute, args=(slow, b"slow"))
    other.start()
    try:
        compute(fast, b"fast")
        assert content_of(shared("reader")) == b"fast"
    finally:
        done.set()
        other.join()
    assert content_of(shared("late reader")) == b"slow"


def test_bytes_that_were_changed_on_their_way_are_sent_again(shared, files, monkeypatch):
    store = shared("one")
    put_file, sent = store.files._filesystem.put_file, []

    def garbled(source, to):
        sent.append(to)
        put_file(source, to) if sent.count(to) > 1 else files.pipe_file(to, b"noise")

    monkeypatch.setattr(store.files._filesystem, "put_file", garbled)
    compute(store)
    assert content_of(shared("two")) == b"frames"


def test_an_upload_that_always_arrives_damaged_is_never_seen(shared, files, monkeypatch):
    store = shared("one")
    filesystem = store.files._filesystem
    monkeypatch.setattr(filesystem, "put_file", lambda _, to: files.pipe_file(to, b"noise"))
    with pytest.raises(InputError, match=r"give back what was uploaded.*kept on this machine"):
        compute(store)
    assert shared("two").find(ClipArtifact, KEY) is None


def test_a_store_that_is_away_for_a_moment_costs_the_moment(shared, monkeypatch, tmp_path):
    store = shared("one")
    put_file, failures = store.files._filesystem.put_file, [ConnectionResetError("cut"), OSError()]

    def flaky(source, to):
        if failures:
            raise failures.pop()
        put_file(source, to)

    monkeypatch.setattr(retry, "WAITS_S", (0.01, 0.01))
    monkeypatch.setattr(store.files._filesystem, "put_file", flaky)
    compute(store)
    assert content_of(shared("two")) == b"frames"


def test_a_store_out_of_reach_is_one_clear_line(impatient, monkeypatch, reachable, tmp_path):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    store = open_store(f"s3://elsewhere/{tmp_path.name}", tmp_path / "one")
    begun = time.monotonic()
    with pytest.raises(InputError, match=r"s3://elsewhere.*reachable.*Check the network") as error:
        store.find(ClipArtifact, KEY)
    assert "\n" not in str(error.value)
    assert time.monotonic() - begun < 30.0


def test_what_was_computed_while_the_store_was_away_is_uploaded_later(
    shared, impatient, monkeypatch
):
    store = shared("one")

    def away(*_):
        raise ConnectionRefusedError("nobody answers")

    with monkeypatch.context() as patched:
        patched.setattr(store.files._filesystem, "put_file", away)
        with pytest.raises(InputError, match="finished stages are kept"):
            compute(store)
    assert shared("one").find(ClipArtifact, KEY).cached
    assert content_of(shared("two")) == b"frames"


def test_a_mistake_of_our_own_is_not_tried_again(monkeypatch):
    tries = []

    def mistaken():
        tries.append(1)
        raise TypeError("no such argument")

    with pytest.raises(TypeError):
        retry.persistent("s3://bucket", mistaken)
    assert len(tries) == 1


def test_a_manifest_that_names_a_file_outside_of_its_folder_is_not_followed(
    shared, files, tmp_path
):
    compute(shared("one"))
    manifest = objects(files, shared("one"))[-1]
    content = json.loads(files.cat_file(manifest))
    content["payloads"][0]["path"] = "../../../escaped"
    files.pipe_file(manifest, json.dumps(content).encode())
    assert shared("two").find(ClipArtifact, KEY) is None
    assert not list(tmp_path.rglob("escaped"))


def test_processes_of_one_machine_that_fetch_one_artifact_do_not_disturb_each_other(shared):
    compute(shared("one"))
    found = []
    readers = [
        threading.Thread(target=lambda: found.append(compute(shared("two")))) for _ in range(4)
    ]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    assert [artifact.cached for artifact in found] == [True] * 4
