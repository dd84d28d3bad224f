"""The cache contract of a stage, with Prefect running."""

from __future__ import annotations

import time

import pytest
from prefect import flow, get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId
from prefect.context import FlowRunContext
from pydantic import Field

from mocoflow_core.artifacts import ClipArtifact, MeshArtifact
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.io.store import Store
from tasks.source import Source
from tasks.stage import Stage, stage

pytestmark = pytest.mark.usefixtures("prefect_server")


class Rate(ConfigurationPart):
    fps: float = Field(12.0, gt=0)


@stage(ClipArtifact, version=1)
def copy_source(work: Stage, source: Source, rate: Rate):
    content = source.path.read_text()
    if content == "bad":
        raise InputError("A good source", content, "Write a better one.")
    work.progress(0.5, "half-way")
    (work.folder / "copy.txt").write_text(content)
    return {"length": len(content)}


@stage(MeshArtifact, version=1)
def double(work: Stage, clip: ClipArtifact, times: int):
    (work.folder / "double.txt").write_text((work.open(clip) / "copy.txt").read_text() * times)
    return {}


@flow
def two_stages(store, source, rate, times):
    clip = copy_source(store, source, rate)
    mesh = double(store, clip, times)
    return clip, mesh, str(FlowRunContext.get().flow_run.id)


def run(store, file, fps=12.0, times=2):
    source = Source(path=file, digest=digest_file(file))
    return two_stages(store, source, Rate(fps=fps), times)


def states(flow_run_id):
    with get_client(sync_client=True) as client:
        runs = client.read_task_runs(
            flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=[flow_run_id]))
        )
    return {run.name: run.state_name for run in runs}


def in_the_end(look, expected, within_s=20.0):
    """What is seen once it is as expected, or at the end: a server writes states down in time."""
    until = time.monotonic() + within_s
    while (seen := look()) != expected and time.monotonic() < until:
        time.sleep(0.2)
    return seen


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "store")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "source.txt"
    path.write_text("frames")
    return path


def cached(outcome):
    clip, mesh, _ = outcome
    return clip.cached, mesh.cached


def test_a_second_run_computes_nothing_and_says_so(store, file):
    assert cached(run(store, file)) == (False, False)
    second = run(store, file)
    assert cached(second) == (True, True)
    expected = {"extract_clip": "Cached", "ingest_meshes": "Cached"}
    assert in_the_end(lambda: states(second[2]), expected) == expected


def test_the_same_bytes_elsewhere_are_a_hit(store, file):
    run(store, file)
    assert cached(run(store, file.rename(file.with_name("moved.txt")))) == (True, True)


def test_a_changed_byte_is_a_miss(store, file):
    run(store, file)
    file.write_text("framez")
    clip, mesh, _ = run(store, file)
    assert not clip.cached
    assert (store.folder(mesh) / "double.txt").read_text() == "framezframez"


def test_a_field_that_a_stage_does_not_read_does_not_redo_it(store, file):
    run(store, file)
    assert cached(run(store, file, times=3)) == (True, False)
    assert cached(run(store, file, fps=6.0)) == (False, False)


def test_a_deleted_payload_is_computed_again_and_what_follows_is_still_valid(store, file):
    clip, _, _ = run(store, file)
    (store.folder(clip) / "copy.txt").unlink()
    assert cached(run(store, file)) == (False, True)


def test_a_damaged_artifact_is_computed_again_and_a_person_is_told(store, file, monkeypatch):
    told = []
    monkeypatch.setattr("tasks.stage.terminal_line", told.append)
    clip, _, _ = run(store, file)
    assert told == []
    (store.folder(clip) / "copy.txt").write_text("framez")
    assert cached(run(store, file)) == (False, True)
    [line] = told
    assert line == (
        f"extract_clip/{clip.key} is damaged and computed again: "
        "copy.txt has changed since it was written"
    )


def test_an_emptied_store_is_filled_again_whatever_prefect_remembers(store, file, tmp_path):
    run(store, file)
    assert cached(run(Store(tmp_path / "other"), file)) == (False, False)


def test_bad_input_arrives_as_it_was_raised(store, file):
    file.write_text("bad")
    with pytest.raises(InputError, match="A good source, got bad"):
        run(store, file)
