from __future__ import annotations

import subprocess
import sys

import cv2
import numpy as np
import pytest
from trimesh import Trimesh

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.synthetic.toy import ToyConfig, write_toy_scene


def test_the_toy_scene_opens_and_its_meshes_are_the_truth(toy_scene):
    scene = open_scene(toy_scene)
    assert len(scene.cameras) == 3
    meshes = MeshSequence.load(toy_scene / "meshes.npz")
    with np.load(toy_scene / "truth.npz") as truth:
        assert np.array_equal(meshes.vertices, truth["vertices"])
        found = np.einsum("kv,tvd->tkd", meshes.keypoint_regressor, meshes.vertices)
        assert found == pytest.approx(truth["keypoints3d"], abs=1e-5)


def test_the_figure_is_one_closed_surface_facing_outwards(toy_scene):
    meshes = MeshSequence.load(toy_scene / "meshes.npz")
    figure = Trimesh(meshes.vertices[0], meshes.faces, process=False)
    assert figure.is_watertight
    assert figure.body_count == 1
    assert figure.volume > 0.05


def test_limbs_move_against_the_torso(toy_scene):
    meshes = MeshSequence.load(toy_scene / "meshes.npz")
    with np.load(toy_scene / "truth.npz") as truth:
        keypoints = truth["keypoints3d"]
    wrist_to_hip = np.linalg.norm(keypoints[:, 9] - keypoints[:, 11], axis=-1)
    assert np.ptp(wrist_to_hip) > 0.15
    assert meshes.vertices.shape[0] == 8


def test_the_figure_fills_seventy_per_cent_of_the_train_image(toy_scene):
    for frame in range(8):
        mask = cv2.imread(str(toy_scene / f"masks/cam00/{frame:06d}.png"), cv2.IMREAD_GRAYSCALE)
        assert mask.any(axis=1).sum() >= 0.7 * 32


def test_sizes_are_free(tmp_path):
    write_toy_scene(tmp_path / "toy", ToyConfig(frames=2, width=24, height=48, cameras=1))
    assert cv2.imread(str(tmp_path / "toy/frames/cam00/000001.png")).shape == (48, 24, 3)


def test_the_toy_needs_no_body_model():
    code = "import sys, mocoflow_core.synthetic.toy; sys.exit('anny' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
