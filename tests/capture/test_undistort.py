"""Laws of bringing pictures to the working size."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.undistort import WorkingView, distort
from tests.capsule_person import look_at

CAMERA = look_at([0, -3, 1], [0, 0, 1], 120, 120, 160)
BENT = replace(CAMERA, distortion=np.array([-0.2, 0.05, 0.003, -0.002, 0.01]))


def test_distortion_agrees_with_opencv():
    pixels = np.random.default_rng(0).uniform(0, 120, (50, 2))
    rays = np.concatenate([(pixels - CAMERA.K[:2, 2]) / 120, np.ones((50, 1))], axis=1)
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), BENT.K, BENT.distortion)
    assert np.allclose(distort(pixels, BENT), expected[:, 0], atol=1e-9)


def test_without_distortion_pixels_stay():
    pixels = np.random.default_rng(0).uniform(0, 120, (50, 2))
    assert np.allclose(distort(pixels, CAMERA), pixels, atol=1e-9)


@pytest.mark.parametrize("max_side", [160, 80, 57])
def test_a_point_is_seen_where_the_working_camera_projects_it(max_side):
    point = np.array([0.31, 0.2, 1.35])
    # A smooth blob drawn where the lens puts the point.
    place = distort(CAMERA.project(point)[None], BENT)[0]
    x, y = np.meshgrid(np.arange(120) + 0.5, np.arange(160) + 0.5)
    blob = 255 * np.exp(-((x - place[0]) ** 2 + (y - place[1]) ** 2) / (2 * 4.0**2))
    view = WorkingView.of(BENT, max_side)
    image = view.image(blob.astype(np.uint8)).astype(float)
    rows, columns = np.indices(image.shape) + 0.5
    seen = np.array([(columns * image).sum(), (rows * image).sum()]) / image.sum()
    # The lens bends the blob itself a little, and bytes round its rim away.
    assert np.abs(seen - view.camera.project(point)).max() < 0.1


def test_shrinking_averages_the_covered_area():
    picture = np.random.default_rng(0).integers(0, 256, (160, 120, 3)).astype(np.uint8)
    shrunk = WorkingView.of(CAMERA, 40).image(picture)
    assert shrunk.shape == (40, 30, 3)
    expected = picture.reshape(40, 4, 30, 4, 3).mean(axis=(1, 3))
    assert np.abs(shrunk - expected).max() <= 0.5 + 1e-9


def test_pictures_are_never_enlarged():
    view = WorkingView.of(CAMERA, 4000)
    assert (view.camera.width, view.camera.height) == (120, 160)


def test_a_mask_pixel_is_true_where_most_of_its_area_is():
    mask = np.zeros((160, 120), np.uint8)
    mask[:, :62] = 255
    small = WorkingView.of(CAMERA, 40).mask(mask)
    assert small[:, :15].all()
    assert not small[:, 16:].any()
