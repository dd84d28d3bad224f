"""The whole flow on a toy scene."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterKey

from mocoflow_core.artifacts import SceneArtifact
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.io.run_folder import read_run
from mocoflow_core.io.store import Store
from mocoflow_core.metrics.curve import (
    CLOCKED_STAGES,
    CURVE_METRICS,
    NETWORK_METRICS,
    read_curve,
)
from mocoflow_core.metrics.table import read_scores
from tests.flows.stages import STAGES


def test_a_run_leaves_everything_that_a_user_keeps(first_run):
    out, record = first_run
    assert [stage.name for stage in record.stages] == STAGES
    for name in ("plan.json", "report.html", "turntable.mp4"):
        assert (out / name).stat().st_size > 0
    for camera in ("cam01", "cam02"):
        assert (out / "views" / camera / "000003.png").is_file()
        assert (out / "opacity" / camera / "000003.png").is_file()
    assert {row.method for row in read_scores(out / "scores.parquet")} == {
        "mocoflow",
        "posed_mesh",
    }
    measured = {row.metric for row in read_curve(out / "error_curve.parquet")}
    assert measured == {*CURVE_METRICS} - {*NETWORK_METRICS}  # which are off by default
    assert read_run(out) == record
    assert json.loads((out / "plan.json").read_text())["decisions"]


def test_the_training_clock_of_the_curve_starts_after_the_preparation(first_run):
    out, record = first_run
    preparation = STAGES[: STAGES.index("optimise_scene")]
    spent = sum(record.stage(name).wall_s for name in preparation)
    curve = read_curve(out / "error_curve.parquet")
    assert min(row.wall_s for row in curve if row.method == "mocoflow") > spent
    assert {row.method for row in curve} == {"mocoflow", "posed_mesh"}


def test_the_curve_has_the_score_of_held_out_train_pixels_at_each_kept_state(first_run):
    out, _ = first_run
    curve = [row for row in read_curve(out / "error_curve.parquet") if row.method == "mocoflow"]
    steps = {m: [r.step for r in curve if r.metric == m] for m in ("train_psnr", "psnr_union")}
    assert steps["train_psnr"] == steps["psnr_union"]
    assert all(row.value > 0 for row in curve if row.metric == "train_psnr")


def test_the_run_s_page_shows_every_point_of_that_curve(first_run):
    out, _ = first_run
    curve = read_curve(out / "error_curve.parquet")
    rows = [
        f"| {row.wall_s:.1f} | {row.cpu_s:.1f} | {row.step} | {row.value:.2f} |"
        for row in curve
        if row.metric == "train_psnr"
    ]
    wanted = ArtifactFilter(key=ArtifactFilterKey(any_=["train-psnr"]))
    shown = get_client(sync_client=True).read_artifacts(artifact_filter=wanted)
    assert any(artifact.data.splitlines()[2:] == rows for artifact in shown)


def test_a_budget_below_the_preparation_ends_with_a_warning_and_a_scene(
    reconstruct, toy_scene, tmp_path
):
    record = reconstruct(toy_scene, tmp_path / "out", budget_s=0.01)
    assert any("untrained" in warning for warning in record.warnings)
    assert "untrained" in (tmp_path / "out" / "report.html").read_text()
    assert "psnr_union" in record.scores["mocoflow"]["cam01"]


def test_the_recorded_seconds_of_the_optimisation_are_those_of_the_training_clock(first_run):
    """Without the looks at the curve; opening its inputs and committing take little."""
    out, record = first_run
    stages = [stage for stage in record.stages if stage.name in CLOCKED_STAGES]
    last = max(row.wall_s for row in read_curve(out / "error_curve.parquet"))
    assert sum(stage.wall_s for stage in stages) == pytest.approx(last, abs=1.0)


def test_the_machine_is_the_one_that_optimised(first_run):
    _, record = first_run
    assert set(record.machine) >= {"cores", "model", "load", "threads"}


def test_a_second_run_computes_nothing_and_leaves_the_same(first_run, reconstruct, toy_scene):
    out, first = first_run
    again = out.with_name("again")
    second = reconstruct(toy_scene, again)
    assert all(stage.cached for stage in second.stages)
    assert second.scores == first.scores
    assert digest_file(again / "report.html") == digest_file(out / "report.html")


def test_a_moved_scene_is_found(first_run, reconstruct, toy_scene, tmp_path):
    shutil.copytree(toy_scene, tmp_path / "elsewhere")
    moved = reconstruct(tmp_path / "elsewhere", tmp_path / "out")
    assert all(stage.cached for stage in moved.stages)


def test_a_changed_learning_rate_redoes_the_optimisation_and_nothing_before(
    first_run, reconstruct, toy_scene, tmp_path
):
    record = reconstruct(toy_scene, tmp_path / "out", settings=("schedule.rate_features=0.01",))
    recomputed = [stage.name for stage in record.stages if not stage.cached]
    assert recomputed == ["optimise_scene", "render_views", "score_views", "write_report"]


def test_a_deleted_payload_is_rebuilt_with_the_same_parameters(
    first_run, reconstruct, toy_scene, store_url, tmp_path
):
    _, record = first_run
    store = Store(Path(store_url))
    model = _model(store, record)
    before = digest_file(model)
    model.unlink()
    rebuilt = reconstruct(toy_scene, tmp_path / "out")
    assert [stage.name for stage in rebuilt.stages if not stage.cached] == ["optimise_scene"]
    assert digest_file(model) == before


def _model(store, record):
    artifact = store.find(SceneArtifact, record.stage("optimise_scene").key)
    return store.folder(artifact) / "model.safetensors"


def test_a_black_frame_and_a_frozen_mesh_are_named_in_the_record(reconstruct, toy_scene, tmp_path):
    spoilt = shutil.copytree(toy_scene, tmp_path / "spoilt")
    black = spoilt / "frames" / "cam00" / "000005.png"
    Image.fromarray(np.zeros((32, 32, 3), np.uint8)).save(black)
    meshes = MeshSequence.load(spoilt / "meshes.npz")
    meshes.vertices[1:5] = meshes.vertices[1]
    meshes.save(spoilt / "meshes.npz")
    record = reconstruct(spoilt, tmp_path / "out")
    assert any("frame 5 of cam00 left out" in words for words in record.warnings)
    assert any("does not move in 4 frames (1-4)" in words for words in record.warnings)
    assert "left out: more than" in (tmp_path / "out" / "report.html").read_text()


def test_the_run_s_page_has_the_plan_as_a_table(first_run):
    out, _ = first_run
    decided = json.loads((out / "plan.json").read_text())["decisions"]
    wanted = ArtifactFilter(key=ArtifactFilterKey(any_=["plan"]))
    (shown, *_) = get_client(sync_client=True).read_artifacts(artifact_filter=wanted)
    rows = json.loads(shown.data)
    names = [decision["name"].replace("_", " ") for decision in decided]
    assert [row["name"] for row in rows] == [*names, "evaluation cameras"]
    assert {row["part"] for row in rows} == {"preparation", "optimisation", "scoring"}
