"""Translations for another camera: what one picture fixes is kept exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.capture.undistort import distort
from mocoflow_core.estimators.placement import (
    ToolCamera,
    box_placement,
    placed,
    refocused,
    weak_translations,
)
from mocoflow_core.geometry.camera import Camera

K = np.array([[900.0, 0, 270], [0, 930.0, 260], [0, 0, 1]])
CAMERA = Camera("cam", 640, 480, K, np.eye(3), np.zeros(3))
CENTRED = replace(CAMERA, K=np.array([[900.0, 0, 320], [0, 900, 240], [0, 0, 1]]))
ANCHORS = np.array([[0.02, -0.3, 0.05], [-0.01, -0.2, -0.1]])


def pixels(points, camera=CAMERA):
    return camera.project(points)


def test_a_weak_camera_in_a_box_is_the_usual_closed_form_for_a_centred_camera():
    s, tx, ty, side = 0.8, 0.1, -0.2, 224.0
    cam, centre = np.array([[s, tx, ty]]), np.array([[250.0, 300.0]])
    placement = box_placement(cam, centre, np.array([side]))
    [found] = weak_translations(*placement, np.zeros((1, 3)), CENTRED)
    z = 2 * 900 / (s * side)
    expected = [tx + z * (250 - 320) / 900, ty + z * (300 - 240) / 900, z]
    assert found == pytest.approx(expected, abs=1e-12)


def test_a_weak_camera_keeps_pixel_and_size_of_the_anchor_for_any_principal_point():
    scale_px, origin_px = np.array([110.0, 95.0]), np.array([[200.0, 300.0], [400.0, 100.0]])
    found = weak_translations(scale_px, origin_px, ANCHORS, CAMERA) + ANCHORS
    assert pixels(found) == pytest.approx(origin_px + scale_px[:, None] * ANCHORS[:, :2])
    assert np.sqrt(900 * 930) / found[:, 2] == pytest.approx(scale_px)


def test_another_focal_length_keeps_x_and_y_and_scales_the_depth():
    translations = np.array([[0.3, -0.1, 40.0]])
    tool = ToolCamera(9000.0, np.array([320.0, 240.0]))
    [found] = refocused(translations, np.zeros((1, 3)), tool, CENTRED)
    assert found == pytest.approx([0.3, -0.1, 4.0])


def test_another_camera_keeps_the_pixel_and_the_size_of_the_anchor():
    translations = np.array([[0.3, -0.1, 40.0], [-0.6, 0.2, 55.0]])
    tool = ToolCamera(np.array([9000.0, 12000.0]), np.array([300.0, 251.0]))
    found = refocused(translations, ANCHORS, tool, CAMERA) + ANCHORS
    before = translations + ANCHORS
    scale_px = tool.focal_px / before[:, 2]
    assert pixels(found) == pytest.approx(tool.centre + scale_px[:, None] * before[:, :2])
    assert np.sqrt(900 * 930) / found[:, 2] == pytest.approx(scale_px)


def test_the_same_camera_changes_nothing_and_is_not_mentioned():
    bodies = np.random.default_rng(0).normal([0, 0, 4], 0.3, (3, 20, 3)).astype(np.float32)
    moved, remarks = placed("Tool", bodies, ToolCamera(900.0, np.array([320.0, 240.0])), CENTRED)
    assert np.allclose(moved, bodies, atol=1e-6)
    assert remarks == ()


def test_lens_distortion_is_taken_off_the_anchors_pixel():
    bent = replace(CAMERA, distortion=np.array([-0.2, 0.05, 0.001, -0.001, 0.0]))
    origin_px, scale_px = np.array([[80.0, 60.0]]), np.array([100.0])
    found = weak_translations(scale_px, origin_px, np.zeros((1, 3)), bent)
    seen = distort(pixels(found, bent.undistorted()), bent)
    assert seen == pytest.approx(origin_px, abs=1e-2)
