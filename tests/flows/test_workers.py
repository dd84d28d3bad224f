"""What the cells of a benchmark may run on."""

from __future__ import annotations

import os
import sys

import pytest

from flows import dask_workers
from flows.benchmark_request import BenchmarkRequest
from flows.cell_task import seen_from_here
from flows.dask_workers import run_on_dask
from flows.slots import held_slot, require_slots
from mocoflow_core.errors import InputError

CORES = len(os.sched_getaffinity(0))


def request(out, **changes) -> BenchmarkRequest:
    return BenchmarkRequest(
        **{"scenes": ("turn",), "out": out, "methods": ("mocoflow",), **changes}
    )


@pytest.mark.parametrize(
    ("changes", "because"),
    [
        ({"workers": 0}, "--workers must be 1 to"),
        ({"workers": CORES + 1}, f"--workers must be 1 to {CORES}"),
        ({"workers": 2, "dask": "tcp://127.0.0.1:1"}, "here or on a --dask cluster"),
        ({"dask": "tcp://127.0.0.1"}, "an address with its port"),
    ],
)
def test_what_cannot_work_is_refused_before_any_cell(changes, because, tmp_path):
    with pytest.raises(InputError, match=because):
        request(tmp_path / "out", **changes).claim()
    assert not (tmp_path / "out").exists()


def test_without_its_package_dask_is_refused_with_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "prefect_dask", None)
    monkeypatch.setattr("flows.workers.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"mocoflow\[dask\]"):
        request(tmp_path / "out", dask="tcp://127.0.0.1:1").claim()


def test_the_command_says_what_the_cells_run_on(tmp_path):
    dask = request(tmp_path, dask="tcp://127.0.0.1:8786", slots="GPU").command
    assert dask.endswith("--dask tcp://127.0.0.1:8786 --slots GPU")
    assert request(tmp_path, workers=2).command.endswith("--workers 2")
    assert "--workers" not in request(tmp_path).command


def test_cells_name_places_that_another_process_finds_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "someone").mkdir()
    asked = request("out", scenes=("./someone",), presets=("toy",), seeds=1, store_url="store")
    [cell] = asked.cells()
    assert cell.out.is_absolute()
    assert cell.request.scene_path == tmp_path.resolve() / "someone"
    assert cell.request.store_url == str(tmp_path.resolve() / "store")


def test_a_finished_cell_whose_files_are_not_here_is_none(tmp_path):
    (tmp_path / "someone").mkdir()
    asked = request(tmp_path / "out", scenes=(str(tmp_path / "someone"),), seeds=1)
    [cell] = asked.cells()
    finished = cell.record.model_copy(update={"state": "finished", "reason": ""})
    assert seen_from_here(cell, finished).state == "failed"
    assert "not shared" in seen_from_here(cell, finished).reason
    (cell.out).mkdir(parents=True)
    (cell.out / "run.json").write_text("{}")
    assert seen_from_here(cell, finished) == finished


def test_slots_that_do_not_exist_are_refused(prefect_server):
    with pytest.raises(InputError, match="prefect gcl create nothing-such"):
        require_slots("nothing-such")
    with held_slot(None):
        pass  # Nothing to wait for.


def test_a_scheduler_that_does_not_answer_is_refused(prefect_server, monkeypatch):
    monkeypatch.setattr(dask_workers, "_CONNECT_S", 1.0)
    with pytest.raises(InputError, match="a scheduler that answers"):
        run_on_dask([], "tcp://127.0.0.1:9", None)


WORKER = {"host": "127.0.0.1", "nthreads": 1, "resources": {"GPU": 1}}


class Client:
    """A client of a cluster with some workers."""

    def __init__(self, *workers: dict) -> None:
        self._workers = {str(number): worker for number, worker in enumerate(workers)}

    def scheduler_info(self) -> dict:
        return {"workers": self._workers}


@pytest.mark.parametrize(
    ("workers", "slots", "has_server", "because"),
    [
        ((), None, True, "A Dask worker at least"),
        ((WORKER,), "TPU", True, "with the resource TPU"),
        ((WORKER | {"nthreads": 4},), None, True, "--nthreads 1"),
        ((WORKER | {"host": "10.0.0.7"},), "GPU", False, "PREFECT_API_URL"),
    ],
)
def test_a_cluster_that_could_never_run_a_cell_is_refused(workers, slots, has_server, because):
    with pytest.raises(InputError, match=because):
        dask_workers._require_workers(Client(*workers), slots, has_server)


def test_a_cluster_that_can_is_not():
    dask_workers._require_workers(Client(WORKER), "GPU", False)
    dask_workers._require_workers(Client(WORKER | {"host": "10.0.0.7"}), None, True)
