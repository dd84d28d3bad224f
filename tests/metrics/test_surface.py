from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.rasterise import rasterise, surface_points
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.metrics.surface import surface_distance, surface_mm

BOX = trimesh.creation.box((1.0, 1.0, 1.0))


def test_distance_to_a_box_follows_its_closed_form() -> None:
    points = np.random.default_rng(0).normal(size=(300, 3))
    outside = np.linalg.norm(np.maximum(np.abs(points) - 0.5, 0), axis=1)
    inside = np.maximum(0.5 - np.abs(points).max(axis=1), 0)
    np.testing.assert_allclose(
        surface_distance(points, BOX.vertices, BOX.faces), outside + inside, atol=1e-9
    )


def test_what_a_camera_sees_of_the_truth_lies_on_it() -> None:
    K = np.array([[40.0, 0, 16], [0, 40.0, 16], [0, 0, 1]])
    camera = Camera("cam", 32, 32, K, np.eye(3), np.array([0.1, 0.2, 3.0]))
    seen = surface_points(rasterise(BOX.vertices, BOX.faces, camera), camera)
    # Depth is stored in single precision: 3 m times 1e-7.
    assert surface_mm(seen, BOX.vertices, BOX.faces) < 1e-3


def test_a_face_moved_outwards_is_that_far_away() -> None:
    points = np.array([[0.52, 0.1, 0.2], [0.52, -0.4, 0.3]])
    assert surface_mm(points, BOX.vertices, BOX.faces) == pytest.approx(20.0)


def test_no_surface_is_an_error_and_never_a_perfect_score() -> None:
    with pytest.raises(InputError, match="none"):
        surface_mm(np.zeros((0, 3)), BOX.vertices, BOX.faces)
