"""Whoever may start a run on a worker reads and writes below the worker's roots alone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flows.allowed_folders import AllowedFolders
from flows.benchmark_request import BenchmarkRequest
from flows.request import Request
from flows.users_store import open_users_store
from mocoflow_core.errors import InputError


@pytest.fixture
def roots(tmp_path, monkeypatch):
    """Two roots of data, one of results, and a folder that is none of them."""
    for name in ("films", "studio", "results", "elsewhere"):
        (tmp_path / name).mkdir()
    data = os.pathsep.join((str(tmp_path / "films"), str(tmp_path / "studio")))
    monkeypatch.setenv("MOCOFLOW_DATA_ROOTS", data)
    monkeypatch.setenv("MOCOFLOW_RESULTS_ROOT", str(tmp_path / "results"))
    return tmp_path


@pytest.fixture
def allowed(roots):
    return AllowedFolders.of_environment()


def test_without_roots_a_path_is_as_it_was_given(tmp_path, monkeypatch):
    for name in ("MOCOFLOW_DATA_ROOTS", "MOCOFLOW_RESULTS_ROOT", "MOCOFLOW_STORE"):
        monkeypatch.delenv(name, raising=False)
    free, odd = AllowedFolders.of_environment(), tmp_path / "a" / ".." / "b"
    assert free.to_read(odd, "scene") is odd
    assert free.to_write(odd, "out") is odd
    assert free.to_keep("s3://bucket/store") == "s3://bucket/store"
    assert free.to_keep(None) is None


@pytest.mark.parametrize(
    "leaving", ["{0}/elsewhere", "{0}/films/../elsewhere", "../elsewhere", "/"]
)
def test_a_scene_that_leaves_the_data_roots_is_refused_by_their_names(allowed, roots, leaving):
    with pytest.raises(InputError, match="scene must lie below") as refused:
        allowed.to_read(Path(leaving.format(roots)), "scene")
    assert str(roots / "films") in str(refused.value)
    assert "MOCOFLOW_DATA_ROOTS" in str(refused.value)


@pytest.mark.parametrize("leaving", ["{0}/elsewhere/run", "{0}/results/../run", "../run", "/run"])
def test_results_that_leave_their_root_are_refused_by_its_name(allowed, roots, leaving):
    with pytest.raises(InputError, match="out must lie below") as refused:
        allowed.to_write(Path(leaving.format(roots)), "out")
    assert str(roots / "results") in str(refused.value)


def test_a_link_inside_that_leads_outside_is_refused(allowed, roots):
    (roots / "films" / "link").symlink_to(roots / "elsewhere")
    (roots / "results" / "link").symlink_to(roots / "elsewhere")
    with pytest.raises(InputError, match="scene must lie below"):
        allowed.to_read(roots / "films" / "link", "scene")
    with pytest.raises(InputError, match="out must lie below"):
        allowed.to_write(roots / "results" / "link" / "run", "out")


def test_a_folder_beside_a_root_whose_name_begins_like_it_is_outside(allowed, roots):
    (roots / "films-private").mkdir()
    with pytest.raises(InputError):
        allowed.to_read(roots / "films-private", "scene")


def test_a_relative_path_lies_below_a_root(allowed, roots):
    (roots / "studio" / "somebody").mkdir()
    assert allowed.to_read(Path("somebody"), "scene") == roots / "studio" / "somebody"
    assert allowed.to_write(Path("run"), "out") == roots / "results" / "run"


def test_a_root_may_be_a_link_itself(roots, monkeypatch):
    (roots / "named").symlink_to(roots / "films")
    monkeypatch.setenv("MOCOFLOW_DATA_ROOTS", str(roots / "named"))
    allowed = AllowedFolders.of_environment()
    assert allowed.to_read(roots / "named" / "scene", "scene") == roots / "films" / "scene"


def test_a_store_is_among_the_results_or_the_workers_own(roots, monkeypatch):
    monkeypatch.setenv("MOCOFLOW_STORE", "s3://ours/store")
    allowed = AllowedFolders.of_environment()
    assert allowed.to_keep(None) == allowed.to_keep("s3://ours/store") == "s3://ours/store"
    assert allowed.to_keep("kept") == str(roots / "results" / "kept")
    for elsewhere in ("s3://theirs/store", "file:///etc", "simplecache::file:///etc", "/etc"):
        with pytest.raises(InputError, match="store must"):
            allowed.to_keep(elsewhere)
    with pytest.raises(InputError, match="store must"):
        open_users_store("/etc")


@pytest.mark.parametrize(
    "asked",
    [
        {"scene_path": "{0}/elsewhere"},
        {"meshes": "{0}/elsewhere/meshes.npz"},
        {"settings": ("meshes.body_model={0}/elsewhere/model.pkl",)},
        {"settings": ("meshes.faces=/etc/passwd",)},
        {"store_url": "{0}/elsewhere"},
        {"out": "{0}/elsewhere/run"},
    ],
    ids=lambda asked: next(iter(asked)),
)
def test_no_parameter_of_a_reconstruction_leads_outside(asked, roots, toy_scene, monkeypatch):
    monkeypatch.setenv(
        "MOCOFLOW_DATA_ROOTS", os.pathsep.join((str(toy_scene), str(roots / "films")))
    )
    given = {"scene_path": toy_scene, "preset": "toy", "out": "run"}

    def claim(parameters):
        out = parameters.pop("out")
        return Request(**parameters).claim(Path(out)).path

    assert claim(dict(given)) == roots / "results" / "run"
    filled = {
        name: tuple(v.format(roots) for v in value)
        if isinstance(value, tuple)
        else value.format(roots)
        for name, value in asked.items()
    }
    with pytest.raises(InputError, match="must"):
        claim(given | filled)
    assert not (roots / "elsewhere" / "run").exists()


def test_no_parameter_of_a_benchmark_leads_outside(roots):
    def ask(**changes):
        return BenchmarkRequest(**{"scenes": ("turn",), "out": roots / "results" / "b"} | changes)

    ask().claim()
    with pytest.raises(InputError, match="out must lie below"):
        ask(out=roots / "elsewhere").claim()
    with pytest.raises(InputError, match="scenes must lie below"):
        ask(scenes=(str(roots / "elsewhere"),)).claim()


def test_a_synthetic_scene_can_be_named_where_roots_are_set(roots):
    scene = Request(scene_path="turn,frames=4").scene
    assert scene.description.name == "turn,frames=4"
