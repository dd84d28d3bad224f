"""Whoever may start a run on a worker does not choose whom the worker speaks to."""

from __future__ import annotations

import socket

import pytest

from flows.allowed_addresses import require_allowed_address
from flows.benchmark_request import BenchmarkRequest
from flows.request import Request
from mocoflow_core.errors import InputError

VARIABLES = ("MOCOFLOW_DATA_ROOTS", "MOCOFLOW_RESULTS_ROOT", "MOCOFLOW_CLUSTER_ADDRESSES")
DASK, MEETING = "tcp://10.0.0.7:8786", "gpu0:29400"


@pytest.fixture(autouse=True)
def nothing_told(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(params=["MOCOFLOW_DATA_ROOTS", "MOCOFLOW_RESULTS_ROOT"])
def worker(request, monkeypatch, tmp_path, toy_scene):
    """A worker that is told some of its folders."""
    monkeypatch.setenv(
        request.param, str(toy_scene if "DATA" in request.param else tmp_path / "results")
    )


@pytest.fixture
def nobody_speaks(monkeypatch):
    def connect(*_):
        raise AssertionError("a connection was tried")

    monkeypatch.setattr(socket.socket, "connect", connect)


def on_dask(tmp_path, address):
    return BenchmarkRequest(scenes=("turn",), out=tmp_path / "results" / "b", dask=address)


def on_machines(scene, address):
    return Request(scene_path=scene, preset="toy", machines=2, rendezvous=address)


def test_on_a_command_line_any_address_will_do(tmp_path, toy_scene):
    on_dask(tmp_path, DASK).claim()
    assert on_machines(toy_scene, MEETING).processes.rendezvous == MEETING


def test_a_worker_speaks_to_no_address_that_it_was_not_told(
    worker, nobody_speaks, tmp_path, toy_scene
):
    with pytest.raises(InputError, match=r"dask must .*MOCOFLOW_CLUSTER_ADDRESSES: none"):
        on_dask(tmp_path, DASK).claim()
    with pytest.raises(InputError, match=r"rendezvous must .*MOCOFLOW_CLUSTER_ADDRESSES: none"):
        on_machines(toy_scene, MEETING).claim(tmp_path / "results" / "run")
    assert not (tmp_path / "results").exists()


def test_what_it_was_told_it_speaks_to(worker, monkeypatch, tmp_path, toy_scene):
    monkeypatch.setenv("MOCOFLOW_CLUSTER_ADDRESSES", f"{DASK}, {MEETING}")
    on_dask(tmp_path, DASK).claim()
    assert on_machines(toy_scene, MEETING).processes.rendezvous == MEETING


@pytest.mark.parametrize("other", ["tcp://10.0.0.7:87", f"{DASK}/", f" {DASK}", "", f"{DASK},"])
def test_an_address_is_told_to_the_letter(other, monkeypatch):
    monkeypatch.setenv("MOCOFLOW_CLUSTER_ADDRESSES", f"{DASK},")
    with pytest.raises(InputError, match="MOCOFLOW_CLUSTER_ADDRESSES"):
        require_allowed_address(other, "dask")
