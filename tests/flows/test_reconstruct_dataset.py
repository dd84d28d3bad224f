"""A data set's folder goes through the flow and gives what its recording gives as a scene."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from flows.imported_scene import scene_folder
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from tests.datasets.snapshot_layout import turning, write_snapshot
from tests.small_smpl import write_smpl

FRAMES, SIDE = 8, 64


def write_native(folder, recording):
    """The same recording as a scene folder, by the README alone."""
    camera = recording.camera
    for part in ("frames", "masks"):
        (folder / part).mkdir(parents=True)
    for number, (frame, mask) in enumerate(zip(recording.frames, recording.masks, strict=True)):
        cv2.imwrite(str(folder / f"frames/{number:06d}.png"), frame[..., ::-1])
        cv2.imwrite(str(folder / f"masks/{number:06d}.png"), 255 * mask.astype(np.uint8))
    bodies = recording.bodies.astype(np.float32)
    faces = np.asarray(recording.model.faces, np.int32)
    MeshSequence(np.arange(len(bodies), dtype=np.int32), bodies, faces).save(folder / "meshes.npz")
    described = {
        "format": "mocoflow-scene",
        "version": 1,
        "name": "native",
        "fps": recording.fps,
        "behind_person": "white",
        "world": {"unit": "m", "up": "-y"},
        "train_camera": "camera",
        "cameras": {
            "camera": {**camera.to_json(), "frames": "frames", "masks": "masks"},
        },
        "meshes": {"file": "meshes.npz", "coordinates": "world", "located": True},
    }
    (folder / "scene.json").write_text(json.dumps(described))
    return folder


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A subject of People-Snapshot, the user's body model, and the native original."""
    folder = tmp_path_factory.mktemp("data")
    models = folder / "mocoflow/body_models"
    models.mkdir(parents=True)
    write_smpl(models / "SMPL_FEMALE.pkl", vertices=600)
    recording = turning(FRAMES, SIDE, models / "SMPL_FEMALE.pkl")
    write_snapshot(folder / "female-9-casual", recording)
    write_native(folder / "native", recording)
    return folder


def test_a_subject_is_reconstructed_as_its_native_original_is(
    reconstruct, store_url, data, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_DATA_HOME", str(data))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scene_folder.cache_clear()
    runs = [reconstruct(data / name, tmp_path / name) for name in ("female-9-casual", "native")]
    imported, native = (
        Clip.load(Path(store_url) / "extract_clip" / run.stage("extract_clip").key) for run in runs
    )
    assert np.array_equal(imported.frames, native.frames)
    assert np.array_equal(imported.masks, native.masks)
    assert (imported.background == 255).all()
    assert (imported.fps, imported.held_out.sum()) == (12, 3)
    ours, theirs = (run.scores for run in runs)
    for method in ("mocoflow", "posed_mesh"):
        assert ours[method]["camera"] == pytest.approx(theirs[method]["camera"])
    assert ours["mocoflow"]["camera"]["mask_iou"] > 0.8
