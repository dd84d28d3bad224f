"""The benchmark flow on a toy scene beside one that cannot be read."""

from __future__ import annotations

import json
import shutil
import sys
import threading
import time
from contextvars import copy_context
from pathlib import Path

import pytest
from prefect.client.orchestration import get_client
from prefect.client.schemas.objects import StateType
from prefect.exceptions import Abort
from prefect.states import Cancelling
from pyarrow import parquet

from flows import benchmark_scenes, regression_event
from flows.benchmark import NothingFinished
from flows.benchmark_request import BenchmarkRequest
from flows.command_line import main
from flows.run_cells import run_cells
from flows.workers import Workers
from mocoflow_core.errors import InputError
from mocoflow_core.io.manifest import MANIFEST
from mocoflow_core.metrics.curve import read_curve
from mocoflow_core.metrics.history import FEWEST_NIGHTS
from mocoflow_core.metrics.table import read_scores

METHODS = ("mocoflow", "without_local", "posed_mesh")


@pytest.fixture(scope="module")
def broken_scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes") / "broken"
    folder.mkdir()
    (folder / "scene.json").write_text("{")
    return folder


@pytest.fixture(scope="module")
def compare(prefect_server, toy_scene, broken_scene, store_url):
    from flows.benchmark import benchmark as flow

    usual = {
        "scenes": (str(broken_scene), str(toy_scene)),
        "methods": METHODS,
        "presets": ("toy",),
        "seeds": 2,
        "store": store_url,
    }
    return lambda out, **changes: flow(out=out, **usual | changes)


@pytest.fixture(scope="module")
def first(compare, tmp_path_factory):
    out = tmp_path_factory.mktemp("benchmarks") / "first"
    return out, compare(out)


def test_every_cell_is_run_and_one_that_fails_stops_no_other(first):
    _, record = first
    states = {cell.name: cell.state for cell in record.cells}
    assert states == {
        f"{scene}/toy/{method}/{seed}": state
        for scene, state in (("broken", "failed"), ("toy", "finished"))
        for method in METHODS[:2]
        for seed in (0, 1)
    }
    assert all("scene.json" in cell.reason for cell in record.cells if cell.state == "failed")
    assert any("broken/toy/mocoflow, seed 0, 1" == row["what"] for row in record.omissions)


def test_prefect_shows_each_cell_by_its_name_and_the_comparison(first):
    _, record = first
    with get_client(sync_client=True) as client:
        runs = {run.name: run for run in client.read_flow_runs()}
        shown = {artifact.key: artifact for artifact in client.read_artifacts()}
    assert "data:image/png" in shown["benchmark"].data
    assert "broken/toy/mocoflow" in shown["benchmark"].data
    assert "posed_mesh" in shown["benchmark-scores"].data
    for cell in record.cells:
        assert runs[cell.name].parent_task_run_id
        assert runs[cell.name].state.is_completed() == (cell.state == "finished")


def test_the_tables_hold_every_method_seed_and_preset(first):
    out, _ = first
    for name, read in (("scores.parquet", read_scores), ("error_curve.parquet", read_curve)):
        cells = {(row.scene, row.method, row.seed) for row in read(out / name)}
        assert cells == {("toy", method, seed) for method in METHODS for seed in (0, 1)}
        assert set(parquet.read_table(out / name)["preset"].to_pylist()) == {"toy"}


def test_scores_of_a_method_are_those_of_its_runs(first):
    out, record = first
    alone = read_scores(out / "cells/toy/toy/without_local/1/scores.parquet")
    together = read_scores(out / "scores.parquet")
    assert [row.value for row in together if (row.method, row.seed) == ("without_local", 1)] == [
        row.value for row in alone if row.method == "mocoflow"
    ]
    [summary] = [
        row
        for row in record.summary
        if (row["method"], row["metric"]) == ("posed_mesh", "psnr_union")
    ]
    assert (summary["seeds"], summary["low"]) == (2, summary["high"])  # Nothing random in it.


def test_a_benchmark_leaves_its_page_chart_times_and_record(first):
    out, record = first
    assert json.loads((out / "benchmark.json").read_text())["command"] == record.command
    assert record.command in (out / "benchmark.html").read_text().replace("&#39;", "'")
    assert (out / "error_against_time.png").stat().st_size > 0
    times = parquet.read_table(out / "time_to_target.parquet").to_pylist()
    assert {(row["method"], row["seeds"]) for row in times} == {(m, 2) for m in METHODS}


def test_a_second_benchmark_computes_nothing_and_leaves_the_same(first, compare, store_url):
    out, record = first

    def touched():
        kept = [file for file in Path(store_url).glob("*/*/*") if file.name != MANIFEST]
        return {file: file.stat().st_mtime_ns for file in (*(out / "cells").rglob("*"), *kept)}

    before = touched()
    assert compare(out) == record
    assert touched() == before


def test_elsewhere_its_cells_come_from_the_store(first, compare, toy_scene, tmp_path):
    out, _ = first
    again = compare(tmp_path / "again", scenes=(str(toy_scene),), methods=METHODS[:1], seeds=1)
    [cell] = again.cells
    assert cell.from_store
    alone = [row for row in read_scores(out / "scores.parquet") if row.method == "mocoflow"]
    assert read_scores(tmp_path / "again/scores.parquet") == [r for r in alone if r.seed == 0]


def test_a_frame_that_cannot_be_read_fails_its_cell_alone(compare, toy_scene, tmp_path):
    """The error is the system's and no bad input's."""
    scene = tmp_path / "dangling"
    shutil.copytree(toy_scene, scene)
    frame = scene / "frames" / "cam00" / "000003.png"
    frame.unlink()
    frame.symlink_to("nowhere")
    asked = {"scenes": (str(scene), str(toy_scene)), "methods": METHODS[:1], "seeds": 1}
    record = compare(tmp_path / "out", **asked)
    assert [cell.state for cell in record.cells] == ["failed", "finished"]
    assert "000003.png" in record.cells[0].reason
    assert "000003.png" in (tmp_path / "out" / "table.md").read_text()
    with get_client(sync_client=True) as client:
        runs = {run.name: run.state for run in client.read_flow_runs()}
    assert runs["dangling/toy/mocoflow/0"].is_failed()


def test_whatever_goes_wrong_outside_of_a_cells_run_is_its_failure(tmp_path, monkeypatch):
    scenes = [tmp_path / name for name in ("one", "two")]
    for scene in scenes:
        scene.mkdir()
    request = BenchmarkRequest(scenes=tuple(map(str, scenes)), out=tmp_path / "out", seeds=1)

    def run(cell, slots):
        if cell.record.scene == "one":
            raise PermissionError("not yours")
        return cell.record.model_copy(update={"state": "finished"})

    monkeypatch.setattr("flows.run_cells.run_cell", run)
    first, second = run_cells(request.cells(), Workers())
    assert (first.state, first.reason) == ("failed", "PermissionError: not yours")
    assert second.state == "finished"


@pytest.mark.parametrize("end", [KeyboardInterrupt, SystemExit, Abort])
def test_who_ends_the_benchmark_ends_it_in_a_cell_too(end, tmp_path, monkeypatch):
    (tmp_path / "one").mkdir()
    request = BenchmarkRequest(scenes=(str(tmp_path / "one"),), out=tmp_path / "out", seeds=1)

    def run(cell, slots):
        raise end()

    monkeypatch.setattr("flows.run_cells.run_cell", run)
    with pytest.raises(end):
        run_cells(request.cells(), Workers())


def cancel_when_running(name: str) -> None:
    """As a person does on Prefect's pages, as soon as a run of that name is to be seen."""
    with get_client(sync_client=True) as client:
        for _ in range(1200):
            for run in client.read_flow_runs():
                if run.name == name and run.state.is_running():
                    client.set_flow_run_state(run.id, Cancelling(), force=True)
                    return
            time.sleep(0.05)


def test_a_cell_can_be_cancelled_alone_and_the_same_benchmark_goes_on_from_there(
    compare, toy_scene, tmp_path
):
    scene = tmp_path / "cancelled"
    shutil.copytree(toy_scene, scene)
    asked = {"scenes": (str(scene),), "methods": METHODS[:1], "settings": ("schedule.rays=63",)}
    name = "cancelled/toy/mocoflow/0"
    # Prefect's settings of this session go with the context.
    person = threading.Thread(target=copy_context().run, args=(cancel_when_running, name))
    person.start()
    record = compare(tmp_path / "out", **asked)
    person.join()
    assert [cell.state for cell in record.cells] == ["cancelled", "finished"]
    assert any("cancelled on Prefect" in str(row) for row in record.omissions)
    with get_client(sync_client=True) as client:
        [state] = {run.state.type for run in client.read_flow_runs() if run.name == name}
    assert state == StateType.CANCELLED
    again = compare(tmp_path / "out", **asked)
    assert [cell.state for cell in again.cells] == ["finished", "finished"]


def test_a_benchmark_afresh_takes_nothing_from_another_store(first, compare, toy_scene, tmp_path):
    one = {"scenes": (str(toy_scene),), "methods": METHODS[:1], "seeds": 1}
    [cell] = compare(tmp_path / "afresh", store=None, afresh=True, **one).cells
    assert not cell.from_store
    stages = {path.name for path in (tmp_path / "afresh/store").iterdir()}
    assert {"extract_clip", "optimise_scene", "write_benchmark"} <= stages


def test_a_night_that_is_worse_than_those_before_says_so(
    first, compare, toy_scene, tmp_path, monkeypatch
):
    asked = {"scenes": (str(toy_scene),), "methods": METHODS[:1], "seeds": 1}
    told = []
    monkeypatch.setattr(regression_event, "emit_event", lambda **event: told.append(event))
    for night in range(FEWEST_NIGHTS):
        assert not compare(tmp_path / f"night{night}", **asked).regressions
        file = tmp_path / f"night{night}" / "benchmark.json"
        record = json.loads(file.read_text())
        for row in record["summary"]:
            row["mean"] += 5.0 if row["metric"] == "psnr_union" else 0.0
        file.write_text(json.dumps(record))
    assert not told
    [worse] = compare(tmp_path / "tonight", **asked).regressions
    assert worse["what"] == "toy/toy/mocoflow: PSNR, person"
    [event] = told
    assert worse["why"] in event["payload"]["text"]
    page = (tmp_path / "tonight/benchmark.html").read_text()
    assert "Over the nights" in page
    assert worse["why"] in page
    nights = parquet.read_table(tmp_path / "tonight/history.parquet")["night"].unique()
    assert len(nights) == FEWEST_NIGHTS + 1


def test_one_of_which_nothing_finished_has_failed_and_says_why(compare, broken_scene, tmp_path):
    with pytest.raises(NothingFinished, match="none of 1 runs"):
        compare(tmp_path / "out", scenes=(str(broken_scene),), methods=METHODS[:1], seeds=1)
    record = json.loads((tmp_path / "out/benchmark.json").read_text())
    assert record["finished"]
    assert "scene.json" in (tmp_path / "out/benchmark.html").read_text()


@pytest.mark.parametrize(
    ("changes", "because"),
    [
        ({"scenes": ("swim",)}, "known name"),
        ({"scenes": ("no/such/folder",)}, "Check the path"),
        ({"scenes": ("turn", "walk,name=turn")}, "different names"),
        ({"scenes": ()}, "has a scene"),
        ({"seeds": 0}, "has a scene, a seed"),
        ({"methods": ("posed_mesh",)}, "a method that is run"),
        ({"afresh": True, "store_url": "there"}, "--afresh has a store of its own"),
        ({"methods": ("without_luck",)}, "--methods must be"),
        ({"methods": ("mocoflow", "mocoflow")}, "--methods must be different"),
        ({"presets": ("fats",)}, "fast, toy"),
        ({"settings": ("schedule.ray=1",)}, "schedule.rays"),
        ({"targets": ("psnr",)}, "psnr_union=20"),
        ({"targets": ("foo=3",)}, "metric must be one of psnr_union"),
        (
            {"targets": ("oks=0.9",)},
            "person_scores.on_curve and networks that are on, to wait for oks",
        ),
    ],
)
def test_what_no_cell_could_run_with_is_refused_before_any(changes, because, tmp_path):
    request = BenchmarkRequest(**{"scenes": ("turn",), "out": tmp_path / "out", **changes})
    with pytest.raises(InputError, match=because):
        request.claim()
    assert not (tmp_path / "out").exists()


def test_a_scene_that_cannot_be_made_is_the_end_of_its_own_cells_alone(tmp_path, monkeypatch):
    def make(name: str) -> Path:
        if name == "walk":
            raise PermissionError("no room")
        return tmp_path / name

    monkeypatch.setattr(benchmark_scenes, "demo_scene", make)
    request = BenchmarkRequest(scenes=("walk", "turn"), out=tmp_path / "out", seeds=1)
    made = {cell.record.scene: cell.record for cell in request.cells()}
    assert (made["walk"].state, made["turn"].state) == ("refused", "failed")
    assert made["walk"].reason == "PermissionError: no room"


def test_a_folder_is_the_same_question_from_everywhere(tmp_path, monkeypatch, toy_scene):
    def question(scene: str) -> str:
        return BenchmarkRequest(scenes=(scene,), out=tmp_path / "out").question

    whole = question(f"{toy_scene}@cam01")
    monkeypatch.chdir(toy_scene.parent)
    assert question(f"./{toy_scene.name}@cam01") == question(f"{toy_scene.name}@cam01") == whole


def test_the_command_line_refuses_likewise_and_takes_several_values(monkeypatch, capsys, tmp_path):
    words = ["benchmark", "--scenes", "turn", "walk", "--methods", "mocoflow", "without_luck"]
    monkeypatch.setattr(sys, "argv", ["mocoflow", *words, "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "without_luck" in capsys.readouterr().err


def test_the_command_of_a_benchmark_asks_for_the_same_again(tmp_path):
    request = BenchmarkRequest(
        scenes=("turn,seed=1",),
        out=tmp_path / "a folder",
        methods=("mocoflow",),
        seeds=2,
        budget_s=30.0,
        settings=("schedule.rays=64",),
        targets=("psnr=20",),
    )
    assert request.command == (
        "mocoflow benchmark --scenes turn,seed=1 --methods mocoflow --presets fast --seeds 2 "
        f"--budget 30 --set schedule.rays=64 --targets psnr=20 --out '{tmp_path}/a folder'"
    )
