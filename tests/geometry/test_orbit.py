from __future__ import annotations

import numpy as np

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.orbit import moved_around

CAMERA = Camera(
    "cam", 64, 48, np.array([[50.0, 0, 30], [0, 55.0, 20], [0, 0, 1]]), np.eye(3), np.zeros(3)
)
PIVOT = np.array([0.3, -0.2, 3.0])


def test_the_pivot_keeps_its_place_in_the_image():
    moved = moved_around(CAMERA, [0.3, 1.1, -0.4], PIVOT)
    assert np.allclose(moved.project(PIVOT), CAMERA.project(PIVOT))


def test_a_whole_turn_and_no_turn_change_nothing():
    for angle in (0.0, 2.0 * np.pi):
        moved = moved_around(CAMERA, [0.0, angle, 0.0], PIVOT)
        assert np.allclose(moved.R, CAMERA.R)
        assert np.allclose(moved.t, CAMERA.t)


def test_half_a_turn_looks_from_the_other_side():
    moved = moved_around(CAMERA, [0.0, np.pi, 0.0], PIVOT)
    assert np.allclose(moved.centre_world, [2 * PIVOT[0], 0.0, 2 * PIVOT[2]])
    assert np.allclose(moved.R @ [0.0, 0.0, -1.0], [0.0, 0.0, 1.0])


def test_moving_the_camera_is_turning_the_world_the_other_way():
    axis = np.array([0.0, 0.7, 0.0])
    point = np.array([0.5, 0.1, 2.5])
    angle = np.linalg.norm(axis)
    c, s = np.cos(-angle), np.sin(-angle)
    turned = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ (point - PIVOT) + PIVOT
    assert np.allclose(moved_around(CAMERA, axis, PIVOT).project(point), CAMERA.project(turned))
