"""Laws of silhouettes."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.body.silhouette import cover, overlap, silhouettes
from mocoflow_core.geometry.camera import Camera


def camera(width: int = 40, height: int = 30) -> Camera:
    K = np.array([[50.0, 0, width / 2], [0, 50.0, height / 2], [0, 0, 1]])
    return Camera("cam", width, height, K, np.eye(3), np.zeros(3))


def inside_by_edges(pixels, faces, width, height):
    """Brute force: each pixel centre against the three edges of each triangle."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    covered = np.zeros((height, width), bool)
    for corners in pixels[faces]:
        sides = []
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            step = end - start
            sides.append(step[0] * (y - start[1]) - step[1] * (x - start[0]))
        sides = np.array(sides)
        covered |= (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
    return covered


@pytest.mark.parametrize("seed", range(5))
def test_a_pixel_is_covered_exactly_when_its_centre_lies_in_a_triangle(seed):
    random = np.random.default_rng(seed)
    pixels = random.uniform(-15, 55, (30, 2))
    faces = random.integers(0, 30, (25, 3)).astype(np.int32)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    assert np.array_equal(cover(pixels, faces, 40, 30), inside_by_edges(pixels, faces, 40, 30))


def test_neighbouring_triangles_leave_no_gap_between_them():
    random = np.random.default_rng(1)
    inner = random.uniform(3, 27, (40, 2))
    corners = np.array([[0, 0], [40, 0], [40, 30], [0, 30.0]])
    from scipy.spatial import Delaunay

    pixels = np.vstack([corners, inner])
    assert cover(pixels, Delaunay(pixels).simplices.astype(np.int32), 40, 30).all()


def test_a_square_covers_its_own_area_wherever_it_is_in_the_image():
    square = np.array([[0, 0], [8, 0], [8, 8], [0, 8.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    assert cover(square + np.array([5.0, 7.0]), faces, 40, 30).sum() == 64
    assert cover(square + np.array([5.3, 7.4]), faces, 40, 30).sum() == 64
    assert cover(square + np.array([-4.0, 26.0]), faces, 40, 30).sum() == 16


def test_a_body_behind_the_camera_covers_nothing():
    points = np.array([[[0, 0, -3], [1, 0, -3], [0, 1, -3.0]]])
    assert not silhouettes(points, np.array([[0, 1, 2]], np.int32), camera()).any()


def test_a_face_without_area_or_out_of_the_image_covers_nothing():
    pixels = np.array([[5.2, 5.2], [9.1, 9.1], [100, 5], [110, 5], [100, 20.0]])
    assert not cover(pixels, np.array([[0, 0, 0], [2, 3, 4]], np.int32), 40, 30).any()


def test_overlap_is_one_for_equal_masks_and_zero_for_disjoint_ones():
    mask = np.zeros((2, 8, 8), bool)
    mask[:, :3] = True
    assert overlap(mask, mask).tolist() == [1, 1]
    assert overlap(mask, ~mask).tolist() == [0, 0]
    assert overlap(mask & False, mask & False).tolist() == [1, 1]
