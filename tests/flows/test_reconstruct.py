"""The whole flow on a toy scene."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
from PIL import Image

from mocoflow_core.artifacts import SceneArtifact
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.io.run_folder import read_run
from mocoflow_core.io.store import Store
from mocoflow_core.metrics.curve import read_curve
from mocoflow_core.metrics.table import read_scores

STAGES = [
    "extract_clip",
    "ingest_meshes",
    "inspect_scene",
    "repair_body",
    "plan_scene",
    "pretrain_density",
    "fit_motion",
    "optimise_scene",
    "extract_evaluation",
    "render_views",
    "score_views",
    "write_report",
]


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
    assert {row.metric for row in read_curve(out / "error_curve.parquet")} >= {"psnr", "mask_iou"}
    assert read_run(out) == record
    assert json.loads((out / "plan.json").read_text())["decisions"]


def test_the_training_clock_of_the_curve_starts_after_the_preparation(first_run):
    out, record = first_run
    preparation = STAGES[: STAGES.index("optimise_scene")]
    spent = sum(record.stage(name).wall_s for name in preparation)
    curve = read_curve(out / "error_curve.parquet")
    assert min(row.wall_s for row in curve if row.method == "mocoflow") > spent
    assert {row.method for row in curve} == {"mocoflow", "posed_mesh"}


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
