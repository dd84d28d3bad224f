"""The cells of one benchmark: one after the other, in two processes, on a Dask cluster."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import pytest

from mocoflow_core.metrics.curve import read_curve
from mocoflow_core.metrics.table import read_scores
from tests.e2e.dask_cluster import ROOT, cluster

pytestmark = pytest.mark.cluster

MAIN = "from flows.command_line import main; main()"
NAMES = [f"toy/toy/mocoflow/{seed}" for seed in (0, 1)]


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes") / "broken"
    folder.mkdir()
    (folder / "scene.json").write_text("{")
    return folder


@pytest.fixture(scope="module")
def on_two(deployed, tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("dask"), deployed.environment) as made:
        yield made


@contextmanager
def benchmark(deployed, folder: Path, scenes: list[Path], *words: str):
    """A benchmark as a person starts it; it is gone after the block."""
    asked = ["--scenes", *map(str, scenes), "--presets", "toy", "--methods", "mocoflow"]
    # What is scored takes longer than all the rest.
    asked += ["--set", "evaluation.frames_per_camera=1"]
    places = ["--out", str(folder / "out"), "--store", str(folder / "store")]
    # With the worker's folders it may speak to what it is told alone.
    told = (
        {"MOCOFLOW_CLUSTER_ADDRESSES": words[words.index("--dask") + 1]}
        if "--dask" in words
        else {}
    )
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, "benchmark", *asked, *places, *words],
        cwd=ROOT,
        env={**deployed.environment, **told, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def finished(deployed, folder: Path, scenes: list[Path], *words: str) -> Path:
    with benchmark(deployed, folder, scenes, "--seeds", "2", *words) as process:
        said, _ = process.communicate(timeout=400.0)
    assert process.returncode == 0, said
    return folder / "out"


def cells_of(out: Path) -> dict[str, dict]:
    cells = json.loads((out / "benchmark.json").read_text())["cells"]
    return {f"{c['scene']}/{c['preset']}/{c['method']}/{c['seed']}": c for c in cells}


def computed_stages(out: Path) -> Counter:
    """How many cells have computed each stage that any of them needed, by its key."""
    stages = [
        stage
        for run in out.glob("cells/*/*/*/*/run.json")
        for stage in json.loads(run.read_text())["stages"]
    ]
    return Counter({s["key"]: 0 for s in stages}) + Counter(
        s["key"] for s in stages if not s["cached"]
    )


def inner_runs(deployed, out: Path) -> list[dict]:
    """The flow runs of all cells of a benchmark."""
    runs = deployed.ask("/flow_runs/filter", {"limit": 200})
    return [r for r in runs if str(r["parameters"].get("out", "")).startswith(f"{out}/cells/")]


def wait_for_running(deployed, out: Path, process, *names: str) -> dict[str, dict]:
    """Until a run of each name is running; give the newest one of each."""
    end = time.monotonic() + 200.0
    while True:
        runs = {r["name"]: r for r in inner_runs(deployed, out) if r["state_type"] == "RUNNING"}
        if runs.keys() >= set(names):
            return runs
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < end, sorted(runs)
        time.sleep(0.1)


def workers_of(process: subprocess.Popen) -> list[int]:
    """The processes that a benchmark has started for its cells."""
    found = []
    for children in Path(f"/proc/{process.pid}/task").glob("*/children"):
        for pid in map(int, children.read_text().split()):
            if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes():
                found.append(pid)
    return found


@pytest.fixture(scope="module")
def alone(deployed, scene, broken, tmp_path_factory):
    return finished(deployed, tmp_path_factory.mktemp("alone"), [broken, scene])


@pytest.fixture(scope="module")
def in_processes(deployed, scene, broken, tmp_path_factory):
    deployed.prefect("gcl", "create", "seat", "--limit", "1")
    folder = tmp_path_factory.mktemp("processes")
    return finished(deployed, folder, [broken, scene], "--workers", "2", "--slots", "seat")


@pytest.fixture(scope="module")
def on_dask(deployed, scene, broken, on_two, tmp_path_factory):
    folder = tmp_path_factory.mktemp("on-dask")
    return finished(deployed, folder, [broken, scene], "--dask", on_two.address, "--slots", "GPU")


@pytest.mark.parametrize("how", ["in_processes", "on_dask"])
def test_wherever_cells_run_they_end_in_the_same_bits(alone, how, request):
    out = request.getfixturevalue(how)
    assert read_scores(out / "scores.parquet") == read_scores(alone / "scores.parquet")
    assert at_the_end(out) == at_the_end(alone)


def at_the_end(out: Path) -> dict[tuple[str, int, str], float]:
    """The last points of the error curves; how many there are before depends on the clock."""
    rows = sorted(read_curve(out / "error_curve.parquet"), key=lambda row: row.step)
    return {(row.method, row.seed, row.metric): row.value for row in rows}


@pytest.mark.parametrize("how", ["alone", "in_processes", "on_dask"])
def test_a_cell_that_fails_is_an_omission_and_stops_no_other(how, request):
    out = request.getfixturevalue(how)
    states = {name: cell["state"] for name, cell in cells_of(out).items()}
    assert states == {
        **{f"broken/toy/mocoflow/{seed}": "failed" for seed in (0, 1)},
        **dict.fromkeys(NAMES, "finished"),
    }
    assert "scene.json" in cells_of(out)["broken/toy/mocoflow/0"]["reason"]
    assert "broken/toy/mocoflow" in (out / "benchmark.html").read_text()


@pytest.mark.parametrize("how", ["alone", "in_processes", "on_dask"])
def test_no_stage_is_computed_twice(how, request):
    times = computed_stages(request.getfixturevalue(how))
    assert set(times.values()) == {1}


@pytest.mark.parametrize("how", ["in_processes", "on_dask"])
def test_every_cell_is_a_flow_run_inside_the_benchmark(deployed, how, request):
    out = request.getfixturevalue(how)
    runs = {run["name"]: run for run in inner_runs(deployed, out)}
    assert runs.keys() == cells_of(out).keys()
    assert all(run["parent_task_run_id"] for run in runs.values())
    assert {runs[name]["state_type"] for name in NAMES} == {"COMPLETED"}


def test_cells_that_share_one_slot_never_run_at_once(deployed, in_processes):
    runs = [run for run in inner_runs(deployed, in_processes) if run["name"] in NAMES]
    first, second = sorted(runs, key=lambda run: run["start_time"])
    assert first["end_time"] <= second["start_time"]


def states_by_name(deployed, out: Path) -> dict[str, Counter]:
    states: dict[str, Counter] = {}
    for run in inner_runs(deployed, out):
        states.setdefault(run["name"], Counter())[run["state_type"]] += 1
    return states


def test_a_cell_whose_process_dies_is_run_again_and_shown(deployed, scene, tmp_path):
    out, asked = tmp_path / "out", ("--seeds", "2", "--workers", "2")
    with benchmark(deployed, tmp_path, [scene], *asked) as process:
        wait_for_running(deployed, out, process, *NAMES)
        os.kill(workers_of(process)[0], signal.SIGKILL)
        said, _ = process.communicate(timeout=400.0)
    assert process.returncode == 0, said
    assert {cell["state"] for cell in cells_of(out).values()} == {"finished"}
    states = states_by_name(deployed, out)
    assert sum(states.values(), Counter()) == {"COMPLETED": 2, "CRASHED": 1}


def test_an_interrupted_benchmark_leaves_no_process_and_no_run(deployed, scene, tmp_path):
    out, asked = tmp_path / "out", ("--seeds", "2", "--workers", "2")
    long = ("--set", "schedule.coarse_steps=100000")
    with benchmark(deployed, tmp_path, [scene], *asked, *long) as process:
        wait_for_running(deployed, out, process, *NAMES)
        started = workers_of(process)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=120.0)
    assert len(started) == 2
    assert not any(Path(f"/proc/{pid}").exists() for pid in started)
    states = sum(states_by_name(deployed, out).values(), Counter())
    assert states.keys() <= {"CANCELLED", "CRASHED"}


def test_a_dask_worker_that_dies_costs_one_try(deployed, scene, on_two, tmp_path):
    out, asked = tmp_path / "out", ("--seeds", "2", "--dask", on_two.address, "--slots", "GPU")
    with benchmark(deployed, tmp_path, [scene], *asked) as process:
        wait_for_running(deployed, out, process, *NAMES)
        on_two.kill("w0")
        said, _ = process.communicate(timeout=400.0)
    assert process.returncode == 0, said
    assert {cell["state"] for cell in cells_of(out).values()} == {"finished"}
    states = states_by_name(deployed, out)
    assert sum(states.values(), Counter()) == {"COMPLETED": 2, "CRASHED": 1}


def test_one_cell_on_dask_is_cancelled_and_the_other_finishes(deployed, scene, on_two, tmp_path):
    out, asked = tmp_path / "out", ("--seeds", "2", "--dask", on_two.address)
    with benchmark(deployed, tmp_path, [scene], *asked) as process:
        deployed.cancel(wait_for_running(deployed, out, process, NAMES[0])[NAMES[0]]["id"])
        said, _ = process.communicate(timeout=400.0)
    assert process.returncode == 0, said
    assert {name: cell["state"] for name, cell in cells_of(out).items()} == {
        NAMES[0]: "cancelled",
        NAMES[1]: "finished",
    }
    assert states_by_name(deployed, out)[NAMES[0]] == {"CANCELLED": 1}
