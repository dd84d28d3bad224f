from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.metrics.keypoints import (
    carried_keypoints,
    keypoint_errors,
    regress_keypoints,
)

R = trimesh.transformations.euler_matrix(0.5, 0.2, -0.3)[:3, :3]
CAMERA = Camera("cam", 64, 64, np.diag([60.0, 60.0, 1.0]), R, np.array([0.2, 0.1, 3.0]))
TRUTH = np.random.default_rng(0).normal(size=(4, 17, 3)) * 0.4


def test_a_step_away_from_the_camera_is_all_depth() -> None:
    sight = TRUTH - CAMERA.centre_world
    further = TRUTH + 0.05 * sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    errors = keypoint_errors(further, TRUTH, CAMERA)
    np.testing.assert_allclose(errors.keypoint_mm, 50.0)
    np.testing.assert_allclose(errors.keypoint_depth_mm, 50.0)
    np.testing.assert_allclose(errors.keypoint_lateral_mm, 0.0, atol=1e-9)
    # It is also invisible: the projection does not move.
    np.testing.assert_allclose(CAMERA.project(further), CAMERA.project(TRUTH))


def test_the_parts_add_up_by_pythagoras() -> None:
    moved = TRUTH[:, :1] + 0.1 * np.random.default_rng(1).normal(size=(4, 1, 3))
    errors = keypoint_errors(moved, TRUTH[:, :1], CAMERA)
    np.testing.assert_allclose(
        errors.keypoint_mm**2, errors.keypoint_lateral_mm**2 + errors.keypoint_depth_mm**2
    )


def test_unknown_keypoints_are_left_out_and_a_frame_without_any_is_nan() -> None:
    truth = TRUTH.copy()
    truth[0, 3:] = np.nan
    truth[2] = np.nan
    errors = keypoint_errors(TRUTH + np.array([0.03, 0, 0]), truth, CAMERA)
    np.testing.assert_allclose(errors.keypoint_mm[[0, 1, 3]], 30.0)
    assert np.isnan(errors.keypoint_mm[2])


def test_frames_that_do_not_match_are_refused() -> None:
    with pytest.raises(InputError, match="source frame numbers"):
        keypoint_errors(TRUTH[:2], TRUTH, CAMERA)


def test_regressed_keypoints_move_with_the_mesh() -> None:
    rng = np.random.default_rng(2)
    regressor = rng.dirichlet(np.ones(30), size=17)
    vertices = rng.normal(size=(2, 30, 3))
    moved = vertices @ R.T + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(
        regress_keypoints(regressor, moved),
        regress_keypoints(regressor, vertices) @ R.T + [1.0, 2.0, 3.0],
    )


def test_keypoints_carried_by_the_true_motion_arrive() -> None:
    frames = np.array([0, 5, 10, 15])
    velocity = np.array([0.01, 0.02, -0.03])
    truth = TRUTH[0] + frames[:, None, None] * velocity
    truth[1, 4] = np.nan
    pairs = [(0, 5), (5, 10), (15, 0)]
    carried, expected = carried_keypoints(
        truth, frames, pairs, lambda x, t: x - t * velocity, lambda x, t: x + t * velocity
    )
    errors = keypoint_errors(carried, expected, CAMERA)
    np.testing.assert_allclose(errors.keypoint_mm, 0.0, atol=1e-9)
    assert np.isnan(carried[1, 4]).all()
    assert np.isnan(expected[0, 4]).all()
