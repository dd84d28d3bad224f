from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.rasterise import interpolate, pixel_rays, rasterise, surface_points
from mocoflow_core.geometry.camera import Camera


def camera(width: int = 40, height: int = 30, focal: float = 35.0) -> Camera:
    K = np.array([[focal, 0, width / 2], [0, 1.1 * focal, height / 2], [0, 0, 1]])
    R = trimesh.transformations.euler_matrix(0.3, -0.4, 0.2)[:3, :3]
    return Camera("cam", width, height, K, R, np.array([0.1, -0.2, 3.0]))


@pytest.fixture
def triangles() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    centres = rng.normal(size=(30, 1, 3)) * 0.6
    vertices = (centres + 0.3 * rng.normal(size=(30, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(90, dtype=np.int32).reshape(-1, 3)


def brute_force(vertices: np.ndarray, faces: np.ndarray, view: Camera) -> tuple:
    """Every pixel against every triangle, by solving a 3 x 3 system each."""
    corners = view.to_camera(vertices)[faces]
    face = np.full((view.height, view.width), -1)
    depth = np.full((view.height, view.width), np.inf)
    weight = np.zeros((view.height, view.width, 3))
    inverse = np.linalg.inv(view.K)
    for y in range(view.height):
        for x in range(view.width):
            ray = inverse @ [x + 0.5, y + 0.5, 1.0]
            for index, triangle in enumerate(corners):
                solution = np.linalg.solve(triangle.T, ray)
                if (solution >= 0).all():
                    z = 1.0 / solution.sum()
                    if z < depth[y, x]:
                        face[y, x], depth[y, x] = index, z
                        weight[y, x] = solution * z
    return face, weight, depth


def test_every_pixel_agrees_with_solving_every_triangle(triangles: tuple) -> None:
    vertices, faces = triangles
    raster = rasterise(vertices, faces, camera())
    face, weight, depth = brute_force(vertices, faces, camera())
    same = raster.face_index == face
    # Single precision may decide a pixel on an edge the other way.
    assert same.mean() > 0.998
    assert (face >= 0).mean() > 0.05
    hit = same & (face >= 0)
    np.testing.assert_allclose(raster.depth[hit], depth[hit], rtol=1e-6)
    np.testing.assert_allclose(raster.barycentric[hit], weight[hit], atol=1e-6)


def test_weights_sum_to_one_and_interpolated_positions_project_to_pixel_centres(
    triangles: tuple,
) -> None:
    vertices, faces = triangles
    view = camera()
    raster = rasterise(vertices, faces, view)
    np.testing.assert_allclose(raster.barycentric[raster.covered].sum(-1), 1.0, atol=1e-6)
    points = interpolate(raster, faces, vertices)[raster.covered]
    rows, columns = np.nonzero(raster.covered)
    centres = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    # Weights are stored in single precision: 1e-7 of a 30 px focal length.
    np.testing.assert_allclose(view.project(points), centres, atol=1e-4)
    np.testing.assert_allclose(surface_points(raster, view), points, atol=1e-5)


def test_a_sphere_covers_the_area_of_its_outline() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    view = Camera("c", 200, 200, np.diag([300.0, 300.0, 1.0]), np.eye(3), np.array([0, 0, 2.0]))
    view.K[:2, 2] = 100
    raster = rasterise(sphere.vertices, sphere.faces, view)
    # A sphere at the optical axis is a disc of radius f r / sqrt(d^2 - r^2).
    radius = 300 * 0.5 / np.sqrt(2.0**2 - 0.5**2)
    assert raster.covered.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
    assert raster.depth.min() == pytest.approx(1.5, abs=2e-3)


def test_a_mesh_behind_the_camera_or_beside_the_image_is_not_seen(triangles: tuple) -> None:
    vertices, faces = triangles
    view = camera()
    behind = view.to_world(np.array([0.0, 0.0, -6.0])) + vertices
    beside = view.to_world(np.array([50.0, 0.0, 3.0])) + vertices
    for moved in (behind, beside):
        raster = rasterise(moved, faces, view)
        assert not raster.covered.any()
        assert np.isinf(raster.depth).all()


def test_a_camera_inside_the_mesh_sees_it_everywhere() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    view = camera()
    raster = rasterise(sphere.vertices + view.centre_world, sphere.faces, view)
    assert raster.covered.all()
    distance = raster.depth * np.linalg.norm(pixel_rays(view), axis=-1)
    assert distance.min() > 1.95
    assert distance.max() < 2.001


def test_a_degenerate_triangle_gives_no_nan() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 4, 3]], np.int32)
    raster = rasterise(vertices, faces, camera())
    assert raster.covered.any()
    assert np.isfinite(raster.barycentric).all()
