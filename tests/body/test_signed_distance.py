from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.signed_distance import signed_distance_lattice

SPACING = 0.03


def sphere(centre=(0.0, 0.0, 0.0), radius: float = 0.3) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    mesh.apply_translation(centre)
    return mesh


def measured(mesh: trimesh.Trimesh, margin: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Lattice points (N, 3) and their distances (N,)."""
    origin, distance = signed_distance_lattice(
        np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32), SPACING, margin
    )
    points = origin + SPACING * np.stack(np.indices(distance.shape), -1)
    return points.reshape(-1, 3), distance.ravel()


def closed_form(points: np.ndarray, centre=(0.0, 0.0, 0.0), radius: float = 0.3) -> np.ndarray:
    return np.linalg.norm(points - centre, axis=-1) - radius


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (0.013, -0.007, 5.0)])
def test_a_sphere_has_the_distance_of_its_closed_form(centre):
    points, found = measured(sphere(centre))
    expected = closed_form(points, centre)
    # The nearest sample lies up to a quarter of the spacing beside the foot point.
    near = np.abs(expected) < 0.1
    assert found[near] == pytest.approx(expected[near], abs=0.25 * SPACING)
    # Far from the surface the distance transform counts cells.
    assert found == pytest.approx(expected, abs=SPACING)


def test_the_sign_is_negative_inside_and_nowhere_else():
    points, found = measured(sphere())
    expected = closed_form(points)
    # The icosphere lies a thousandth inside the sphere.
    clear = np.abs(expected) > 1e-3
    assert np.array_equal(found[clear] < 0, expected[clear] < 0)


def test_where_two_spheres_overlap_the_inside_stays_inside():
    centres = ([-0.12, 0, 0], [0.12, 0, 0])
    points, found = measured(trimesh.util.concatenate([sphere(c) for c in centres]))
    union = np.minimum(*(closed_form(points, centre) for centre in centres))
    clear = np.abs(union) > 0.5 * SPACING
    assert np.array_equal(found[clear] < 0, union[clear] < 0)
    overlap = np.maximum(*(closed_form(points, centre) for centre in centres)) < -0.02
    assert overlap.sum() > 50
    assert (found[overlap] < 0).all()


def test_a_hole_does_not_turn_the_body_inside_out():
    whole = sphere()
    open_mesh = trimesh.Trimesh(
        whole.vertices, whole.faces[whole.triangles_center[:, 2] < 0.28], process=False
    )
    assert not open_mesh.is_watertight
    points, found = measured(open_mesh, margin=0.25)
    expected = closed_form(points)
    near_the_hole = np.linalg.norm(points - [0, 0, 0.29], axis=-1) < 0.14
    clear = (np.abs(expected) > 1e-3) & ~near_the_hole
    assert np.array_equal(found[clear] < 0, expected[clear] < 0)
    above = clear & (np.hypot(points[:, 0], points[:, 1]) < 0.08) & (points[:, 2] > 0.3)
    assert above.any()


def test_lattice_lines_along_edges_and_through_corners_count_once():
    cube = trimesh.creation.box([0.6, 0.6, 0.6])
    points, found = measured(cube, margin=4 * SPACING)
    outside = np.abs(points).max(-1) - 0.3
    clear = np.abs(outside) > 1e-3
    assert np.array_equal(found[clear] < 0, outside[clear] < 0)


def test_the_lattice_holds_the_mesh_with_its_margin():
    mesh = sphere((1.0, 2.0, 3.0))
    points, found = measured(mesh, margin=0.25)
    assert (points.min(0) <= mesh.bounds[0] - 0.25 + 1e-6).all()
    assert (points.max(0) >= mesh.bounds[1] + 0.25 - 1e-6).all()
    assert np.isfinite(found).all()


def test_distances_of_neighbouring_points_differ_by_at_most_their_distance():
    mesh = sphere()
    _, found = signed_distance_lattice(
        np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32), SPACING, 0.1
    )
    for axis in range(3):
        # One spacing, and the change from exact to counted distances.
        assert np.abs(np.diff(found, axis=axis)).max() <= 1.7 * SPACING
