"""What a store holds, what is damaged in it, what can go and what never does."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import s3fs

from mocoflow_core.artifacts import ClipArtifact, PlanArtifact
from mocoflow_core.errors import InputError
from mocoflow_core.io.garbage import age_s, judge, users
from mocoflow_core.io.known_runs import KnownRun, runs_below
from mocoflow_core.io.remote_holdings import holdings_of
from mocoflow_core.io.remote_store import RemoteStore, open_store
from mocoflow_core.io.run_folder import RUN, RunFolder, RunRecord, StageRecord
from mocoflow_core.io.store import Store

KEY, OTHER = "0" * 40, "1" * 40
CLIP, PLAN = f"extract_clip/{KEY}", f"plan_scene/{OTHER}"
DAY_S = 86400.0
HERE = "this machine"


@pytest.fixture(params=["folder", "s3"])
def store(request, tmp_path) -> Store:
    if request.param == "folder":
        return Store(tmp_path / "store")
    return request.getfixturevalue("remote")


@pytest.fixture
def remote(reachable, tmp_path) -> RemoteStore:
    return open_store(f"s3://bucket/{tmp_path.name}", tmp_path / "mirrors")


def compute(store, kind=ClipArtifact, key=KEY, content=b"frames"):
    with store.computing(kind, key, resumes=False) as work:
        if not work.found:
            (work.path / "frames.npy").write_bytes(content)
            return work.commit(1, {}, {}, {})
        return work.found


def place(store):
    return holdings_of(store)[0]


def looked(store):
    return {(item.name, item.leftover): item for item in place(store).look()}


def gone(store, needed=None, older_than_s=0.0, now=None):
    now = time.time() + 2 * DAY_S if now is None else now
    sentences = judge(place(store).look(), needed or {}, older_than_s, now)
    return sorted(sentence.held.name for sentence in sentences if sentence.goes)


def by_none():
    """Nobody needs what is removed."""
    return False


def run_in(folder: Path, finished: bool = True) -> Path:
    """The folder of a run that has left its record."""
    begun = RunRecord(
        request="a", scene="s", scene_path="", preset="toy", seed=0, configuration={}, store=""
    )
    claimed = RunFolder.claim(folder, begun)
    if finished:
        stage = StageRecord(name="extract_clip", key=KEY, wall_s=1.0, cpu_s=1.0, cached=False)
        claimed.finish({"stages": (stage,)})
    return folder


def test_an_artifact_is_listed_with_its_size_age_and_cost(store):
    made = compute(store)
    [item] = place(store).look()
    assert item.name == CLIP
    assert item.size > len(b"frames")
    assert item.wall_s == made.wall_s
    assert abs(time.time() - item.used_at) < 60.0
    assert item.fault is None


def test_all_that_a_run_uses_is_needed_as_long_as_its_folder_is_there(store, tmp_path):
    compute(store)
    store.serve(run_in(tmp_path / "run"), HERE)
    compute(store, PlanArtifact, OTHER)
    store.find(ClipArtifact, KEY)
    needed = users(place(store).runs(), HERE)
    assert needed == {name: [str(tmp_path / "run")] for name in (CLIP, PLAN)}
    assert gone(store, needed) == []
    (tmp_path / "run" / RUN).unlink()
    assert users(place(store).runs(), HERE) == {}
    assert gone(store, users(place(store).runs(), HERE)) == [CLIP, PLAN]


def test_a_run_that_starts_again_keeps_what_it_had_until_it_is_finished(store, tmp_path):
    """It may die again before it is where it was."""
    compute(store)
    store.serve(run_in(tmp_path / "run"), HERE)
    store.find(ClipArtifact, KEY)
    store.serve(tmp_path / "run", HERE)
    assert users(place(store).runs(), HERE).keys() == {CLIP}
    compute(store, PlanArtifact, OTHER)
    assert users(place(store).runs(), HERE).keys() == {CLIP, PLAN}
    store.served()
    assert users(place(store).runs(), HERE).keys() == {PLAN}


def test_a_run_of_another_machine_keeps_what_it_needs(store, tmp_path):
    compute(store)
    elsewhere = KnownRun(folder="/nowhere/run", host="here", machine="another", artifacts=(CLIP,))
    store.write_run(elsewhere)
    assert gone(store, users(place(store).runs(), HERE)) == []
    place(store).forget(elsewhere)
    assert place(store).runs() == []


def test_a_record_from_before_machines_were_told_apart_is_kept_as_another_machines(store):
    store.write_run(KnownRun(folder="/nowhere/run", host="here", artifacts=(CLIP,)))
    assert users(place(store).runs(), HERE).keys() == {CLIP}


def test_a_use_is_written_down_before_the_artifact_is_looked_for(store, tmp_path):
    """Who removes artifacts asks for uses when it has taken one away."""
    store.serve(run_in(tmp_path / "run"), HERE)
    assert store.find(PlanArtifact, OTHER) is None
    assert users(place(store).runs(), HERE).keys() == {PLAN}


def test_a_record_that_changes_is_read_again_though_its_size_and_time_stay(store):
    runs, here = place(store), KnownRun.here(Path("run"), HERE)
    for name in (CLIP, CLIP.replace("0", "2")):
        store.write_run(here.using([name]))
        assert [run.artifacts for run in runs.runs()] == [(name,)]
    runs.forget(here)
    assert runs.runs() == []


def written_as_record(store, content, name="newer.json"):
    if isinstance(store, RemoteStore):
        store.files.make_folder("runs")
        store.files.write(f"runs/{name}", content)
    else:
        (store.root / "runs").mkdir(parents=True, exist_ok=True)
        (store.root / "runs" / name).write_bytes(content)


@pytest.mark.parametrize("content", [b'{"folder": "/run", "host": "here", "needs": []}', b"", b"{"])
def test_a_record_that_cannot_be_read_is_never_taken_for_no_run(store, content):
    written_as_record(store, content)
    with pytest.raises(InputError, match=r"runs/newer\.json.*version of mocoflow"):
        place(store).runs()


def test_a_record_that_is_just_being_written_is_none_yet(store):
    written_as_record(store, b'{"fold', ".new.newer.json")
    assert place(store).runs() == []


def test_a_record_below_the_named_folders_that_cannot_be_read_is_no_missing_run(tmp_path):
    run_in(tmp_path / "run")
    (tmp_path / "run" / RUN).write_text('{"of a newer version": 1}')
    with pytest.raises(InputError, match=r"run\.json.*version of mocoflow"):
        runs_below([tmp_path], HERE)


def test_a_moved_run_is_known_from_the_folder_that_it_was_moved_to(store, tmp_path):
    compute(store)
    run_in(tmp_path / "moved" / "deep" / "run")
    assert gone(store, users(runs_below([tmp_path / "moved"], HERE), HERE)) == []


def test_what_was_used_lately_stays_and_being_found_counts_as_use(tmp_path):
    store = Store(tmp_path)
    made = compute(store)
    old = time.time() - 3 * DAY_S
    os.utime(store.folder(made) / "manifest.json", (old, old))
    assert gone(store, older_than_s=2 * DAY_S, now=time.time()) == [CLIP]
    store.find(ClipArtifact, KEY)
    assert gone(store, older_than_s=2 * DAY_S, now=time.time()) == []


def test_a_clock_that_was_put_back_makes_nothing_old(store):
    compute(store)
    [item] = place(store).look()
    assert age_s(item, item.used_at - 1000 * DAY_S) == 0.0
    assert gone(store, older_than_s=DAY_S, now=item.used_at - 1000 * DAY_S) == []


def test_what_goes_is_removed_and_the_rest_is_whole(store):
    compute(store)
    compute(store, PlanArtifact, OTHER)
    item = looked(store)[CLIP, False]
    assert place(store).remove(item, by_none)
    assert looked(store).keys() == {(PLAN, False)}
    assert place(store).verify(looked(store)[PLAN, False]) is None


def test_an_artifact_that_is_used_between_the_look_and_the_removal_stays(tmp_path):
    store = Store(tmp_path)
    made = compute(store)
    os.utime(store.folder(made) / "manifest.json", (0, 0))
    item = looked(store)[CLIP, False]
    store.find(ClipArtifact, KEY)
    assert not place(store).remove(item, by_none)
    assert store.find(ClipArtifact, KEY)


def test_what_a_run_has_asked_for_when_it_is_removed_is_put_back(store, tmp_path):
    compute(store)
    item = looked(store)[CLIP, False]

    def asked_for_meanwhile():
        assert (CLIP, False) not in looked(store)
        store.write_run(KnownRun.here(run_in(tmp_path / "run"), HERE).using([CLIP]))
        return CLIP in users(place(store).runs(), HERE)

    assert not place(store).remove(item, asked_for_meanwhile)
    assert place(store).verify(looked(store)[CLIP, False]) is None
    assert store.find(ClipArtifact, KEY)


def test_what_nobody_can_tell_about_when_it_is_removed_is_put_back(store):
    compute(store)
    item = looked(store)[CLIP, False]

    def unknown():
        raise InputError("a record that can be read", "none", "Wait.")

    with pytest.raises(InputError):
        place(store).remove(item, unknown)
    assert looked(store).keys() == {(CLIP, False)}


def test_a_killed_try_that_a_run_has_asked_for_meanwhile_stays(tmp_path):
    store = Store(tmp_path)
    (store.root / f"{CLIP}.partial").mkdir(parents=True)
    assert not place(store).remove(looked(store)[CLIP, True], lambda: True)
    assert looked(store).keys() == {(CLIP, True)}


def test_a_changed_byte_is_found_by_verify_alone_and_a_missing_file_by_a_look(tmp_path):
    store = Store(tmp_path)
    payload = store.folder(compute(store)) / "frames.npy"
    payload.write_bytes(b"framez")
    item = looked(store)[CLIP, False]
    assert item.fault is None
    assert place(store).verify(item) == "frames.npy has changed since it was written"
    payload.unlink()
    assert looked(store)[CLIP, False].fault == "frames.npy is missing"


def test_damage_on_object_storage_is_named(remote, storage, tmp_path):
    compute(remote)
    files = storage.files()
    [payload] = [p for p in files.find(f"bucket/{tmp_path.name}") if "manifest" not in p]
    files.pipe_file(payload, b"framez")
    item = looked(remote)[CLIP, False]
    assert item.fault is None
    assert place(remote).verify(item) == "frames.npy has changed since it was written"
    files.rm_file(payload)
    assert looked(remote)[CLIP, False].fault == "frames.npy is missing"


def test_an_unfinished_upload_is_a_leftover_and_its_parts_are_given_back(remote, storage, tmp_path):
    compute(remote)
    files = storage.files()
    payload = f"{tmp_path.name}/plan_scene/{OTHER}/" + "a" * 64
    begun = files.call_s3("create_multipart_upload", Bucket="bucket", Key=payload)
    files.call_s3(
        "upload_part",
        **{"Bucket": "bucket", "Key": payload, "UploadId": begun["UploadId"]},
        **{"PartNumber": 1, "Body": b"part"},
    )
    files.pipe_file(f"bucket/{payload}"[:-1] + "b", b"whole payload without a manifest")
    item = looked(remote)[PLAN, True]
    assert "cut off" in item.fault
    assert place(remote).remove(item, by_none)
    assert files.list_multipart_uploads("bucket") == []
    assert looked(remote).keys() == {(CLIP, False)}


def test_a_store_that_knows_no_open_uploads_may_say_so_as_it_likes(remote, monkeypatch):
    compute(remote)

    def call(self, method, **asked):
        raise FileNotFoundError("NoSuchUpload")

    monkeypatch.setattr(s3fs.S3FileSystem, "call_s3", call)
    assert looked(remote).keys() == {(CLIP, False)}


WORKING = """
import sys, time
from pathlib import Path
from mocoflow_core.artifacts import ClipArtifact
from mocoflow_core.io.store import Store
with Store(Path(sys.argv[1])).computing(ClipArtifact, "0" * 40, resumes=True) as work:
    (work.path / "checkpoint").write_text("step 7")
    print("works", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def at_work(tmp_path):
    """A store and a process that computes an artifact in it."""
    words = [sys.executable, "-c", WORKING, str(tmp_path / "store")]
    root = Path(__file__).parents[2]
    process = subprocess.Popen(words, cwd=root, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "works\n"
    yield Store(tmp_path / "store"), process
    process.kill()
    process.wait()


def test_what_a_live_process_computes_stays_and_what_a_killed_one_left_can_go(at_work):
    store, process = at_work
    item = looked(store)[CLIP, True]
    assert item.busy
    assert gone(store) == []
    assert not place(store).remove(item, by_none)

    process.kill()
    process.wait()
    assert not looked(store)[CLIP, True].busy
    assert gone(store) == [CLIP]
    assert place(store).remove(looked(store)[CLIP, True], by_none)
    assert [path for path in store.root.rglob("*") if path.is_file()] == []


def test_a_killed_try_of_a_kept_run_stays_to_be_resumed(at_work):
    store, process = at_work
    process.kill()
    process.wait()
    assert gone(store, {CLIP: ["run"]}) == []
    compute(store)
    (store.root / f"{CLIP}.rubbish").mkdir()
    assert gone(store, {CLIP: ["run"]}) == [CLIP]  # What is left beside the finished artifact.
