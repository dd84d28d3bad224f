from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.subdivide import levels_for, subdivide, unique_edges


@pytest.fixture
def box() -> trimesh.Trimesh:
    return trimesh.creation.box((1.0, 2.0, 3.0))


def test_each_level_has_four_times_the_faces_on_the_same_surface(box: trimesh.Trimesh) -> None:
    for levels in range(4):
        fine = subdivide(box.faces, len(box.vertices), levels)
        mesh = trimesh.Trimesh(fine.refine(box.vertices), fine.faces, process=False)
        assert len(mesh.faces) == 12 * 4**levels
        assert mesh.area == pytest.approx(box.area)
        assert mesh.volume == pytest.approx(box.volume)
        assert mesh.is_watertight


def test_no_vertex_is_made_twice(box: trimesh.Trimesh) -> None:
    fine = subdivide(box.faces, len(box.vertices), 3)
    points = fine.refine(box.vertices)
    assert len(np.unique(points.round(9), axis=0)) == len(points)


def test_refining_commutes_with_moving_the_mesh(box: trimesh.Trimesh) -> None:
    fine = subdivide(box.faces, len(box.vertices), 2)
    matrix = np.random.default_rng(0).normal(size=(3, 3))
    moved = box.vertices @ matrix + [1, 2, 3]
    np.testing.assert_allclose(
        fine.refine(moved), fine.refine(box.vertices) @ matrix + [1, 2, 3], atol=1e-12
    )


def test_edges_are_halved_until_they_are_short_enough(box: trimesh.Trimesh) -> None:
    levels = levels_for(box.vertices, box.faces, spacing_m=0.1, max_vertices=10**9)
    fine = subdivide(box.faces, len(box.vertices), levels)
    edges, _ = unique_edges(fine.faces)
    points = fine.refine(box.vertices)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    assert 0.05 < np.median(lengths) <= 0.1


def test_the_vertex_count_stays_within_its_bound(box: trimesh.Trimesh) -> None:
    levels = levels_for(box.vertices, box.faces, spacing_m=1e-6, max_vertices=5000)
    # Euler: V = F / 2 + 2 for a closed surface without holes.
    assert len(box.faces) * 4**levels / 2 + 2 <= 5000 < len(box.faces) * 4 ** (levels + 2) / 2


def test_a_point_located_on_the_fine_mesh_is_the_same_point(box: trimesh.Trimesh) -> None:
    rng = np.random.default_rng(0)
    face = rng.integers(0, 12, 500).astype(np.int32)
    # Corners, edges and midpoints are where a point could fall into the wrong child.
    weights = np.concatenate(
        [rng.dirichlet(np.ones(3), 490), np.eye(3), (1 - np.eye(3)) / 2, np.full((4, 3), 1 / 3)]
    )
    points = np.einsum("nk,nkc->nc", weights, box.vertices[box.faces[face]])
    for levels in range(5):
        fine = subdivide(box.faces, len(box.vertices), levels)
        fine_face, fine_weights = fine.locate(face, weights)
        corners = fine.refine(box.vertices)[fine.faces[fine_face]]
        assert fine_weights.min() >= -1e-12
        np.testing.assert_allclose(
            np.einsum("nk,nkc->nc", fine_weights, corners), points, atol=1e-12
        )
