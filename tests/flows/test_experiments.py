"""The paper's experiments as benchmarks, tiny, on the toy scene."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from pyarrow import parquet

from flows import misplaced_scenes
from flows.benchmark_request import BenchmarkRequest
from flows.benchmark_scenes import read_scenes
from mocoflow_core.errors import InputError
from mocoflow_core.io.run_folder import read_run
from mocoflow_core.methods.ablations import SERIES
from mocoflow_core.methods.experiments import EXPERIMENTS
from mocoflow_core.metrics.misalignment import MISPLACEMENTS, read_misalignment
from mocoflow_core.metrics.table import read_scores
from mocoflow_core.presets import fast
from mocoflow_core.settings import with_settings
from tasks.cancellation import RunCancelled
from tests.flows.test_paper import TINY


@pytest.fixture(scope="module")
def compare(prefect_server, toy_scene, store_url):
    from flows.benchmark import benchmark as flow

    usual = {"scenes": (str(toy_scene),), "seeds": 1, "store": store_url}
    return lambda out, **changes: flow(out=out, **usual | changes)


@pytest.fixture(scope="module")
def series(compare, tmp_path_factory):
    """The ends of the paper's series, also asked of a preset for which there is none."""
    out = tmp_path_factory.mktemp("series")
    chosen = {"methods": ("base", "with_box"), "presets": ("toy", "paper"), "settings": TINY}
    return out, compare(out, experiment="progressive", **chosen)


def test_a_cell_that_makes_no_sense_is_an_omission_and_stops_no_other(series):
    _, record = series
    states = {(cell.preset, cell.method): cell.state for cell in record.cells}
    assert states == {
        (preset, method): state
        for preset, state in (("toy", "refused"), ("paper", "finished"))
        for method in ("base", "with_box")
    }
    refused = [row for row in record.omissions if "toy/toy/" in row["what"]]
    assert len(refused) == 2
    assert all("representation=networks" in row["why"] for row in refused)


def test_the_base_makes_no_step_before_the_joint_stage_and_the_whole_method_does(series):
    out, _ = series
    for method, steps in (("base", 0), ("with_box", 6)):
        run = read_run(out / f"cells/toy/paper/{method}/0")
        for name in ("pretrain_density", "fit_motion"):
            manifest = Path(run.store) / name / run.stage(name).key / "manifest.json"
            assert json.loads(manifest.read_text())["summary"]["steps"] == steps
        decided = json.loads((out / f"cells/toy/paper/{method}/0/plan.json").read_text())
        needed = {d["name"]: d["needed"] for d in decided["decisions"]}
        assert needed["initialisation"] == (method == "with_box")


def test_its_table_has_a_row_for_each_step_that_ran(series):
    out, _ = series
    lines = (out / "table.md").read_text().splitlines()
    assert lines[0] == f"# {EXPERIMENTS['progressive'].title}"
    assert [line.split(" | ")[0] for line in lines if line.startswith(("| base", "| with"))] == [
        "| base",
        "| with box",
    ]
    assert EXPERIMENTS["progressive"].title in (out / "benchmark.html").read_text()


def test_a_scene_that_cannot_be_read_is_named_and_the_others_are_misplaced(
    compare, toy_scene, tmp_path
):
    shutil.copytree(toy_scene, tmp_path / "torn")
    frame = sorted((tmp_path / "torn/frames/cam00").iterdir())[0]
    frame.unlink()
    frame.symlink_to("nowhere")
    scenes = (str(tmp_path / "torn"), str(toy_scene))
    quick = ("person_scores.use=off",)
    record = compare(tmp_path / "out", experiment="misalignment", scenes=scenes, settings=quick)
    [unread] = record.omissions
    assert unread["what"] == "torn, misplaced views"
    assert frame.name in unread["why"]
    assert "torn" in (tmp_path / "out/table.md").read_text()
    assert "torn, misplaced views" in (tmp_path / "out/benchmark.html").read_text()
    rows = read_misalignment(tmp_path / "out/misalignment.parquet")
    assert {row.scene for row in rows} == {"toy"}


def test_cancelling_ends_all_of_it(tmp_path, monkeypatch, toy_scene):
    def cancel(*_):
        raise RunCancelled("cancelled")

    monkeypatch.setattr(misplaced_scenes, "misplace_views", cancel)
    asked = {"experiment": "misalignment", "scenes": (str(toy_scene),), "out": tmp_path / "out"}
    with pytest.raises(RunCancelled):
        misplaced_scenes.misplaced_scenes(BenchmarkRequest(**asked))


def test_misplaced_views_need_no_run(compare, tmp_path):
    settings = ("evaluation.frames_per_camera=1",)
    record = compare(tmp_path / "out", experiment="misalignment", settings=settings)
    assert record.cells == ()
    rows = read_misalignment(tmp_path / "out/misalignment.parquet")
    # No keypoints are found in a figure of capsules: no pair, no OKS.
    metrics = {"psnr", "psnr_union", "ssim", "lpips_alex", "plausibility"}
    assert {row.metric for row in rows} == metrics
    assert len(rows) == len(metrics) * len(MISPLACEMENTS)
    assert "Misplaced views" in (tmp_path / "out/benchmark.html").read_text()
    assert "misplaced views" in (tmp_path / "out/table.md").read_text()


def test_partial_observation_trains_on_fewer_frames_and_is_scored_on_the_same(
    compare, toy_scene, tmp_path
):
    out = tmp_path / "out"
    methods = ("mocoflow", "partial_observation")
    # The toy figure turns by 90 degrees: 0.7 leaves out the last frames.
    settings = ("evaluation.least_shown=0.7", "capture.holdout_every=0")
    chosen = {"methods": methods, "presets": ("toy",), "settings": settings}
    compare(out, experiment="partial_observation", **chosen)
    seen = {}
    for method in methods:
        rows = read_scores(out / f"cells/toy/toy/{method}/0/scores.parquet")
        seen[method] = {(r.camera, r.frame_index) for r in rows if r.metric == "psnr_union"}
    assert seen["mocoflow"] == seen["partial_observation"]
    assert {frame for _, frame in seen["mocoflow"]} == {0, 1, 2, 3, 4}
    frames = [
        read_run(out / f"cells/toy/toy/{method}/0").capture["last_frame"] for method in methods
    ]
    assert frames == [7, 6]


def test_the_same_scene_may_be_learned_from_two_cameras(compare, toy_scene, tmp_path):
    scenes = (f"{toy_scene}@cam01",)
    record = compare(tmp_path / "out", scenes=scenes, methods=("mocoflow",), presets=("toy",))
    [cell] = record.cells
    assert (cell.scene, cell.train_camera, cell.state) == ("toy@cam01", "cam01", "finished")
    assert any("given for cam00" in warning for warning in cell.warnings)
    rows = read_scores(tmp_path / "out/scores.parquet")
    assert {row.camera for row in rows if row.metric == "psnr_union"} == {"cam00", "cam02"}
    assert set(parquet.read_table(tmp_path / "out/scores.parquet")["scene"].to_pylist()) == {
        "toy@cam01"
    }


def test_an_experiment_says_what_the_user_does_not(tmp_path):
    asked = BenchmarkRequest(experiment="progressive", out=tmp_path / "out")
    assert asked.methods == (*SERIES, "posed_mesh")
    assert asked.presets == ("paper_small",)
    own = BenchmarkRequest(experiment="progressive", out=tmp_path / "out", presets=("paper_aist",))
    assert (own.presets, own.scenes) == (("paper_aist",), asked.scenes)


def test_settings_of_the_user_come_after_those_of_the_experiment(tmp_path):
    asked = BenchmarkRequest(
        experiment="partial_observation",
        out=tmp_path / "out",
        settings=("evaluation.least_shown=0.3",),
    )
    assert with_settings(fast(), asked.settings).evaluation.least_shown == 0.3


def test_the_command_of_an_experiment_asks_for_the_same_again(tmp_path):
    asked = BenchmarkRequest(experiment="partial_observation", out=tmp_path / "out")
    assert asked.command == (
        "mocoflow benchmark --experiment partial_observation --scenes turn turn_noise6 "
        "--methods mocoflow partial_observation posed_mesh --presets fast --seeds 3 "
        f"--set evaluation.least_shown=0.5 --out {tmp_path}/out"
    )
    again = BenchmarkRequest(
        experiment=asked.experiment, out=asked.out, settings=("evaluation.least_shown=0.5",)
    )
    assert again == asked


@pytest.mark.parametrize(
    ("changes", "because"),
    [
        ({"experiment": "luck", "scenes": ("turn",)}, "--experiment must be"),
        ({"scenes": ("turn",), "methods": ("without_box",)}, "needs representation=networks"),
        ({"scenes": ("turn",), "settings": ("box.fine_samples=3",)}, "box.fine_samples"),
        ({"scenes": ("turn@cam01", "turn@cam01")}, "different names"),
    ],
)
def test_what_makes_no_sense_in_any_cell_is_refused_before_any(changes, because, tmp_path):
    with pytest.raises(InputError, match=because):
        BenchmarkRequest(out=tmp_path / "out", **changes).claim()
    assert not (tmp_path / "out").exists()


def test_scenes_are_named_with_their_settings_and_their_camera(toy_scene):
    words = ("turn", "turn_noise6,seed=1@cam02", f"{toy_scene}@cam01")
    scenes = read_scenes(words)
    assert [scene.name for scene in scenes] == ["turn", "turn_noise6,seed=1@cam02", "toy@cam01"]
    assert [scene.train_camera for scene in scenes] == [None, "cam02", "cam01"]
    assert scenes[2].folder() == toy_scene
    assert scenes[2].settings == ("capture.train_camera=cam01",)
