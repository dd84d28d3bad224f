from __future__ import annotations

import numpy as np
import pytest
from trimesh import Trimesh
from trimesh.proximity import closest_point

from mocoflow_core.synthetic.mesh_estimate import (
    NOISY_JOINTS,
    estimate_meshes,
    with_joint_noise,
)
from mocoflow_core.synthetic.scene_writer import perform


@pytest.fixture(scope="module")
def performed(small_turn, person):
    return perform(small_turn, person)


def _estimate(small_turn, person, performed, kind):
    return estimate_meshes(
        small_turn.model_copy(update={"mesh_estimate": kind}), person, performed[0]
    )


def test_exact_meshes_are_the_rendered_surface_of_tight_clothes(small_turn, person, performed):
    meshes = _estimate(small_turn, person, performed, "exact")
    assert np.abs(meshes.vertices - performed[1].vertices).max() < 1e-6
    assert np.array_equal(meshes.faces, performed[1].surface.faces)


def test_the_other_topology_lies_on_the_rendered_surface(small_turn, person, performed):
    meshes = _estimate(small_turn, person, performed, "other_topology")
    assert meshes.vertices.shape[1] == 1229
    surface = Trimesh(performed[1].vertices[2], performed[1].surface.faces, process=False)
    _, distance, _ = closest_point(surface, meshes.vertices[2])
    # A few of its vertices bridge the lips and the eyes' cavities.
    assert np.quantile(distance, 0.99) < 1e-5
    assert distance.max() < 0.01


def test_the_coarse_regressor_finds_the_keypoints(small_turn, person, performed):
    meshes = _estimate(small_turn, person, performed, "other_topology")
    assert meshes.keypoint_regressor.sum(axis=1) == pytest.approx(np.ones(17), abs=1e-5)
    found = np.einsum("kv,tvd->tkd", meshes.keypoint_regressor, meshes.vertices)
    error = np.linalg.norm(found - performed[1].keypoints3d, axis=-1)
    # Flat triangles cut through round limbs: some millimetres.
    assert error.max() < 0.01


def test_the_coarse_mesh_is_closed_and_has_the_volume_of_a_person(small_turn, person, performed):
    meshes = _estimate(small_turn, person, performed, "other_topology")
    coarse = Trimesh(meshes.vertices[0], meshes.faces, process=False)
    assert coarse.is_watertight
    assert 0.05 < coarse.volume < 0.1  # Cubic metres, about those of water of the same mass.


def test_joint_noise_has_the_promised_root_mean_square_angle(small_turn, performed):
    motion = performed[0]
    configuration = small_turn.model_copy(update={"joint_noise_deg": 6.0})
    noisy = with_joint_noise(motion, configuration)
    for joint in NOISY_JOINTS:
        error = noisy.joints[joint]
        if joint in motion.joints:
            error = error * motion.joints[joint].inv()
        assert np.degrees(np.sqrt((error.magnitude() ** 2).mean())) == pytest.approx(6.0)
    root = noisy.root_rotation * motion.root_rotation.inv()
    assert np.degrees(np.sqrt((root.magnitude() ** 2).mean())) == pytest.approx(6.0)
    assert np.array_equal(noisy.root_position, motion.root_position)


def test_joint_noise_is_smooth_in_time(small_turn, person):
    configuration = small_turn.model_copy(update={"frames": 48})
    motion, _ = perform(configuration.model_copy(update={"motion": "still"}), person)
    noisy = with_joint_noise(motion, configuration).joints["head"]
    steps = np.degrees((noisy[1:] * noisy[:-1].inv()).magnitude())
    assert steps.max() < 0.5 * configuration.joint_noise_deg


def test_noise_of_place_moves_the_whole_body_by_the_promised_root_mean_square(
    small_turn, person, performed
):
    noisy = small_turn.model_copy(update={"place_noise_m": 0.06})
    moved = _estimate(noisy, person, performed, "other_topology").vertices
    errors = moved - _estimate(small_turn, person, performed, "other_topology").vertices
    assert np.ptp(errors, axis=1).max() < 1e-6  # float32 vertices a metre from the origin
    assert np.sqrt((errors[:, 0] ** 2).sum(axis=1).mean()) == pytest.approx(0.06, rel=1e-4)


def test_no_noise_leaves_the_motion_alone(small_turn, performed):
    noisy = with_joint_noise(performed[0], small_turn.model_copy(update={"joint_noise_deg": 0.0}))
    for joint, rotation in performed[0].joints.items():
        assert (noisy.joints[joint] * rotation.inv()).magnitude().max() < 1e-12


def test_another_shape_has_the_same_root_and_other_limbs(small_turn, person, performed):
    right = _estimate(small_turn, person, performed, "other_topology")
    wrong = _estimate(small_turn, person, performed, "other_shape")
    assert np.array_equal(wrong.faces, right.faces)
    hips = np.einsum("kv,tvd->tkd", right.keypoint_regressor, wrong.vertices)[:, 11:13].mean(axis=1)
    root = performed[0].root_position
    assert np.linalg.norm(hips - root, axis=1).max() < 0.1
    error = np.linalg.norm(wrong.vertices - right.vertices, axis=-1)
    assert error.mean() > 0.02
