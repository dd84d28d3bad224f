"""The output of a body estimator goes through the flow from its file."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import open_scene
from tests.estimators.layouts import write_people
from tests.small_smpl import write_smpl


@pytest.fixture
def vibe_output(toy_scene, tmp_path):
    """The toy's bodies about their middles, and where VIBE's network would see them."""
    camera = open_scene(toy_scene).cameras["cam00"]
    meshes = MeshSequence.load(toy_scene / "meshes.npz")
    bodies = camera.to_camera(meshes.vertices.astype(float))
    middles = bodies.mean(axis=1)
    side = np.full(len(bodies), 24.0)
    cam = np.zeros((len(bodies), 3))
    cam[:, 0] = 2 * camera.K[0, 0] / middles[:, 2] / (1.1 * side)
    record = {
        "pred_cam": cam,
        "bboxes": np.column_stack([camera.project(camera.to_world(middles)), side, side]),
        "verts": (bodies - middles[:, None]).astype(np.float32),
        "frame_ids": meshes.frame_indices,
    }
    return write_people(tmp_path / "vibe_output.pkl", {1: record})


def test_vibes_output_is_planned_from_its_file(prefect_server, toy_scene, vibe_output, tmp_path):
    from flows.plan import plan

    settings = (f"meshes.faces={toy_scene / 'meshes.npz'}",)
    store = tmp_path / "store"
    planned = plan(toy_scene, "toy", meshes=vibe_output, settings=settings, store=str(store))
    decisions = {decision.name: decision for decision in planned.decisions}
    assert decisions["location_search"].needed
    [located] = store.glob("locate_body/*/meshes.npz")
    found, truth = (MeshSequence.load(f).vertices for f in (located, toy_scene / "meshes.npz"))
    # A pixel of 32 is 8 cm here.
    assert np.linalg.norm((found - truth).mean(axis=1), axis=-1).max() < 0.08


def test_a_folder_of_body_models_may_be_given_or_be_the_users(
    toy_scene, vibe_output, tmp_path, monkeypatch
):
    from flows.request import Request

    folder = tmp_path / "mocoflow/body_models"
    folder.mkdir(parents=True)
    write_smpl(folder / "SMPL_NEUTRAL.pkl", 500)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "elsewhere"))
    without = Request(scene_path=toy_scene, meshes=vibe_output)
    assert without.body_model is None
    setting = (f'meshes.body_model="{folder}"',)
    given = Request(scene_path=toy_scene, meshes=vibe_output, settings=setting)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    by_default = Request(scene_path=toy_scene, meshes=vibe_output)
    assert given.body_model == by_default.body_model
    assert given.body_model.path == folder / "SMPL_NEUTRAL.pkl"
    assert Request(scene_path=toy_scene).body_model is None
