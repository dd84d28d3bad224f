from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh

from mocoflow_core.fields.body_lattices import BodyMotionConfig, build_body_motion
from mocoflow_core.fields.motion_body import BodyMotion
from tests.rigid_figures import (
    MOTIONS,
    REACH_M,
    Figure,
    figure,
    near_surface,
    rigid_figure,
    rows,
    single,
)


@pytest.fixture(scope="module")
def rigid() -> Figure:
    return rigid_figure()


@pytest.mark.parametrize("row", range(len(MOTIONS)))
def test_a_rigidly_moving_body_maps_exactly_both_ways(rigid, row):
    rotation, shift = MOTIONS[row]
    canonical = near_surface(rigid.mesh, 0.9 * REACH_M)
    observed = rotation.apply(canonical) + shift
    frame = rows(len(canonical), row)
    mapped, near = rigid.body.to_canonical(single(observed), frame)
    assert near.all()
    # Maps in single precision, about points up to 3 m from the origin.
    assert mapped.numpy() == pytest.approx(canonical, abs=1e-5)
    placed, known = rigid.body.to_observed(single(canonical), frame)
    assert known.all()
    assert placed.numpy() == pytest.approx(observed, abs=1e-5)


@pytest.mark.parametrize("row", range(len(MOTIONS)))
def test_surfaces_face_where_the_turned_body_faces(rigid, row):
    rotation, shift = MOTIONS[row]
    points = single(rotation.apply(rigid.mesh.vertices) + shift)
    facing = rigid.body.facing(rigid.body.observed_grids.corners(points, rows(len(points), row)))
    expected = rotation.apply(rigid.mesh.vertex_normals.copy())
    agreement = (facing.numpy() * expected).sum(-1)
    assert np.median(agreement) > 0.98
    assert agreement.min() > 0.8
    assert facing.norm(dim=-1).numpy() == pytest.approx(1.0, abs=1e-5)


def test_distances_are_those_from_the_mesh_of_the_frame(rigid):
    rotation, shift = MOTIONS[1]
    canonical = near_surface(rigid.mesh, 0.9 * REACH_M)
    points = single(rotation.apply(canonical) + shift)
    found = rigid.body.distance(rigid.body.observed_grids.corners(points, rows(400, 1)))
    expected = -trimesh.proximity.signed_distance(rigid.mesh, canonical)
    # Linear between nodes of a distance to points, not to triangles.
    spacing = BodyMotionConfig().node_spacing_m
    assert found.numpy() == pytest.approx(expected, abs=spacing)
    assert np.median(np.abs(found.numpy() - expected)) < 0.4 * spacing


def test_far_points_stay_where_they_are_and_are_infinitely_far(rigid):
    far = torch.tensor([[9.0, 0.0, 0.0], [-1e4, 1e4, 5.0]])
    mapped, near = rigid.body.to_canonical(far, rows(2, 1))
    assert torch.equal(mapped, far)
    assert not near.any()
    corners = rigid.body.observed_grids.corners(far, rows(2, 1))
    assert torch.isposinf(rigid.body.distance(corners)).all()
    assert torch.isfinite(rigid.body.facing(corners)).all()
    placed, known = rigid.body.to_observed(far, rows(2, 1))
    assert torch.equal(placed, far)
    assert not known.any()


@pytest.mark.parametrize("within_m", [0.03, REACH_M])
def test_the_cheap_test_misses_no_near_point_and_drops_far_ones(rigid, within_m):
    rotation, shift = MOTIONS[2]
    spacing = BodyMotionConfig().node_spacing_m
    near = near_surface(rigid.mesh, 0.99 * within_m)
    assert rigid.body.near_body(
        single(rotation.apply(near) + shift), rows(len(near), 2), within_m
    ).all()
    outside = rigid.mesh.vertices + (within_m + 2 * spacing) * rigid.mesh.vertex_normals
    assert not rigid.body.near_body(
        single(rotation.apply(outside) + shift), rows(len(outside), 2), within_m
    ).any()


def limbs(gap: float) -> trimesh.Trimesh:
    """Two upright rods beside each other along x."""
    rod = trimesh.creation.capsule(height=0.4, radius=0.06, count=[16, 16])
    pair = [rod.copy(), rod.copy()]
    for side, limb in zip((-1, 1), pair, strict=True):
        limb.apply_translation([side * (0.06 + 0.5 * gap), 0, 0])
    return trimesh.util.concatenate(pair)


APART = np.array([0.5, 0.0, 0.2])


@pytest.fixture(scope="module")
def parting() -> tuple[Figure, Figure]:
    """Limbs that touch in canonical space and part, and limbs that come into contact."""
    together = limbs(gap=0.01)
    parted = together.vertices + (together.vertices[:, :1] > 0) * APART
    apart = together.copy()
    apart.vertices = parted
    return figure(together, [together.vertices, parted]), figure(apart, [together.vertices])


def in_limbs(mesh: trimesh.Trimesh) -> np.ndarray:
    points = near_surface(mesh, 0.03, count=2000)
    return points[np.abs(points[:, 0]) < 0.12]


def test_limbs_in_contact_in_canonical_space_do_not_mix(parting):
    leaving, _ = parting
    points = in_limbs(leaving.mesh)
    placed, _ = leaving.body.to_observed(single(points), rows(len(points), 1))
    shift = placed.numpy() - points
    with_left, with_right = np.abs(shift).max(-1), np.abs(shift - APART).max(-1)
    # A point goes with one limb or with the other, never half-way.
    assert np.minimum(with_left, with_right).max() < 1e-3
    # Away from the contact it goes with its own.
    spacing = BodyMotionConfig().node_spacing_m
    assert with_left[points[:, 0] < -spacing].max() < 1e-3
    assert with_right[points[:, 0] > spacing].max() < 1e-3


def test_limbs_that_come_into_contact_do_not_mix(parting):
    _, meeting = parting
    points = in_limbs(limbs(gap=0.01))
    mapped = meeting.body.to_canonical(single(points), rows(len(points), 0))[0]
    shift = mapped.numpy() - points
    with_left, with_right = np.abs(shift).max(-1), np.abs(shift - APART).max(-1)
    assert np.minimum(with_left, with_right).max() < 1e-3
    spacing = BodyMotionConfig().node_spacing_m
    assert with_left[points[:, 0] < -spacing].max() < 1e-3
    assert with_right[points[:, 0] > spacing].max() < 1e-3


def test_a_bending_body_comes_back_to_where_it_was():
    rod = trimesh.creation.capsule(height=0.8, radius=0.07, count=[16, 16]).subdivide()
    height = rod.vertices[:, 2]
    angle = np.radians(50) * np.clip(height / 0.4, 0, 1)
    bent = rod.vertices.copy()
    bent[:, 0] += np.where(height > 0, 0.5 * angle * height, 0)
    bending = figure(rod, [bent])
    frame = rows(len(bent), 0)
    mapped = bending.body.to_canonical(single(bent), frame)[0]
    back, known = bending.body.to_observed(mapped, frame)
    assert known.all()
    error = np.linalg.norm(back.numpy() - bent, axis=-1)
    # Blending is not exact where neighbouring controls turn differently: millimetres.
    assert np.median(error) < 2e-3
    assert error.max() < 1e-2


def test_gradients_reach_the_points_and_stay_finite(rigid):
    points = single(
        np.concatenate([near_surface(rigid.mesh, 2.5 * REACH_M), [[50.0, 0, 0]]])
    ).requires_grad_()
    frame = rows(len(points), 0)
    found = rigid.body.to_canonical(points, frame)[0]
    placed, _ = rigid.body.to_observed(points, frame)
    (found.sum() + placed.sum()).backward()
    assert torch.isfinite(points.grad).all()
    # Every map is the identity in the first frame: both directions hand gradients through.
    assert points.grad.numpy() == pytest.approx(2.0, abs=1e-3)


def test_many_frames_are_one_look_up(rigid):
    canonical = near_surface(rigid.mesh, 0.05, count=90)
    frame = torch.arange(90) % len(MOTIONS)
    placed, _ = rigid.body.to_observed(single(canonical), frame)
    for row in range(len(MOTIONS)):
        alone, _ = rigid.body.to_observed(single(canonical), rows(90, row))
        assert torch.equal(placed[frame == row], alone[frame == row])
    back = rigid.body.to_canonical(placed, frame)[0]
    assert back.numpy() == pytest.approx(canonical, abs=2e-5)


def test_a_moment_between_frames_is_the_body_between_frames(rigid):
    moment = build_body_motion(
        rigid.controls.at_time(0.25), rigid.prior, REACH_M, BodyMotionConfig()
    )
    points = near_surface(rigid.mesh, 0.05)
    placed, known = moment.to_observed(single(points), rows(len(points), 0))
    assert known.all()
    distances = torch.pdist(placed[:60].double())
    assert distances.numpy() == pytest.approx(torch.pdist(torch.from_numpy(points[:60])), abs=1e-4)


def test_saved_tables_are_the_same_motion(rigid):
    loaded = BodyMotion.from_tensors(rigid.body.tensors())
    points, frame = single(near_surface(rigid.mesh, 0.05)), rows(400, 0)
    ours, theirs = (body.to_canonical(points, frame) for body in (rigid.body, loaded))
    assert torch.equal(ours[0], theirs[0])
    assert torch.equal(ours[1], theirs[1])
    assert torch.equal(loaded.observed_distance, rigid.body.observed_distance)
    assert torch.equal(loaded.times, rigid.body.times)
