from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from mocoflow_core.body.rigid_controls import RigidControls, best_rotation, rigid_controls


def figure() -> trimesh.Trimesh:
    """An ellipsoid with three different axes, about a torso in size."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    mesh.vertices = mesh.vertices * [0.25, 0.15, 0.5]
    return mesh


def moved(points: np.ndarray, rotation: Rotation, shift: list[float]) -> np.ndarray:
    return (rotation.apply(points) + shift).astype(np.float32)


def measured(mesh: trimesh.Trimesh, frames: list[np.ndarray], spacing: float = 0.08):
    return rigid_controls(
        np.asarray(mesh.vertices, np.float32),
        np.stack(frames).astype(np.float32),
        np.asarray(mesh.faces, np.int32),
        np.linspace(0, 1, len(frames)) if len(frames) > 1 else np.zeros(1),
        spacing,
        neighbours=16,
    )


ROTATIONS = [
    Rotation.identity(),
    Rotation.from_euler("z", 90, degrees=True),
    Rotation.from_euler("xyz", [150, -40, 70], degrees=True),
    Rotation.from_euler("x", 180, degrees=True),
]
SHIFTS = [[0.0, 0, 0], [1.0, -2, 0.5], [0, 0, 3.0], [-5.0, 0, 1]]


@pytest.fixture(scope="module")
def rigid() -> RigidControls:
    mesh = figure()
    frames = [moved(mesh.vertices, *pair) for pair in zip(ROTATIONS, SHIFTS, strict=True)]
    return measured(mesh, frames)


def test_a_rigidly_moved_mesh_gives_that_motion_at_every_control(rigid):
    for row, (rotation, shift) in enumerate(zip(ROTATIONS, SHIFTS, strict=True)):
        # Vertices are single precision up to 5 m from the origin.
        expected = moved(rigid.canonical, rotation, shift)
        assert rigid.rotations[row] == pytest.approx(
            np.broadcast_to(rotation.as_matrix(), rigid.rotations[row].shape), abs=2e-5
        )
        assert rigid.observed[row] == pytest.approx(expected, abs=2e-6)
        surface = moved(rigid.surface, rotation, shift)
        assert rigid.surface_at(row) == pytest.approx(surface, abs=1e-5)


def test_rotations_are_never_reflections():
    mesh = figure()
    rng = np.random.default_rng(0)
    mirrored = mesh.vertices * [-1, 1, 1]
    crumpled = mesh.vertices + 0.3 * rng.normal(size=mesh.vertices.shape)
    flat = mesh.vertices * [1, 0, 1]
    found = measured(mesh, [mirrored, crumpled, flat]).rotations.astype(np.float64)
    assert np.linalg.det(found) == pytest.approx(1.0, abs=1e-5)
    assert found @ np.swapaxes(found, -1, -2) == pytest.approx(
        np.broadcast_to(np.eye(3), found.shape), abs=1e-5
    )


@pytest.mark.parametrize("axes", [[1, 1, 0], [1, 0, 0], [0, 0, 0]])
def test_flat_line_like_and_duplicate_neighbourhoods_turn_with_the_whole_body(axes):
    turn = Rotation.from_euler("y", 60, degrees=True)
    spread = np.random.default_rng(1).normal(size=(1, 24, 3)) * axes * 0.02
    source = (spread - spread.mean(1, keepdims=True)).astype(np.float32)
    target = turn.apply(source[0])[None].astype(np.float32)
    whole = turn.as_matrix().astype(np.float32)
    found = best_rotation(source, target, whole)
    assert np.isfinite(found).all()
    assert found[0] == pytest.approx(whole, abs=1e-3)


def test_duplicate_vertices_and_needle_faces_stay_finite():
    mesh = figure()
    vertices = np.concatenate([mesh.vertices, np.repeat(mesh.vertices[:1], 60, axis=0)])
    needles = len(mesh.vertices) + np.arange(60).reshape(20, 3)
    degenerate = trimesh.Trimesh(vertices, np.concatenate([mesh.faces, needles]), process=False)
    turn = Rotation.from_euler("z", 40, degrees=True)
    found = measured(degenerate, [moved(vertices, turn, [0, 0, 1])])
    for part in (found.canonical, found.observed, found.rotations, found.surface):
        assert np.isfinite(part).all()
    assert found.rotations[0] == pytest.approx(
        np.broadcast_to(turn.as_matrix(), found.rotations[0].shape), abs=1e-4
    )


def test_a_vertex_that_touches_in_one_frame_only_is_no_neighbour():
    still = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    other = still.copy()
    other.apply_translation([0.2, 0, 0])
    both = trimesh.util.concatenate([still, other])
    away = both.vertices.copy()
    away[len(still.vertices) :] += [0.5, 0, 0]
    found = measured(both, [away], spacing=0.05)
    left = found.canonical[:, 0] < 0.1
    shift = found.observed[0] - found.canonical
    assert shift[left] == pytest.approx(0, abs=1e-6)
    assert shift[~left] == pytest.approx(np.tile([0.5, 0, 0], ((~left).sum(), 1)), abs=1e-6)


def test_the_moment_of_a_frame_is_that_frame(rigid):
    for row, time in enumerate(rigid.times):
        moment = rigid.at_time(float(time))
        assert np.array_equal(moment.observed[0], rigid.observed[row])
        assert np.array_equal(moment.rotations[0], rigid.rotations[row])
        assert moment.times.tolist() == [time]


def test_moments_outside_the_clip_are_its_ends(rigid):
    assert np.array_equal(rigid.at_time(-3.0).observed[0], rigid.observed[0])
    assert np.array_equal(rigid.at_time(9.0).observed[0], rigid.observed[-1])


def test_one_frame_is_every_moment():
    mesh = figure()
    alone = measured(mesh, [moved(mesh.vertices, ROTATIONS[2], [1, 0, 0])])
    for time in (0.0, 0.4, 1.0):
        assert np.array_equal(alone.at_time(time).observed, alone.observed)


@pytest.mark.parametrize("degrees", [30, 90, 150, 179])
def test_a_spinning_body_does_not_shrink_between_frames(degrees):
    mesh = figure()
    spin = [Rotation.from_euler("z", angle, degrees=True) for angle in (0, degrees)]
    found = measured(mesh, [moved(mesh.vertices, turn, [0.2, 0, 0]) for turn in spin])
    for share in (0.25, 0.5, 0.9):
        half_way = Rotation.from_euler("z", share * degrees, degrees=True)
        expected = moved(found.canonical, half_way, [0, 0, 0])
        moment = found.at_time(share)
        relative = moment.observed[0] - moment.observed[0].mean(0)
        assert relative == pytest.approx(expected - expected.mean(0), abs=2e-4)
        assert np.linalg.det(moment.rotations[0]) == pytest.approx(1.0, abs=1e-5)


def test_a_limb_that_turns_against_the_body_is_half_turned_half_way():
    body, limb = figure(), trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    limb.apply_translation([0.5, 0, 0])
    whole = trimesh.util.concatenate([body, limb])
    turned = whole.vertices.copy()
    own = slice(len(body.vertices), None)
    turn = Rotation.from_euler("y", 100, degrees=True)
    middle = np.array([0.5, 0, 0])
    turned[own] = turn.apply(turned[own] - middle) + middle
    found = measured(whole, [whole.vertices, turned])
    half = Rotation.from_matrix(found.at_time(0.5).rotations[0])
    in_limb = found.canonical[:, 0] > 0.4
    degrees = np.degrees(half.magnitude())
    # The best rotation of the whole body takes part of the limb's turn.
    assert degrees[in_limb] == pytest.approx(50, abs=3)
    assert degrees[~in_limb].max() < 3


def test_moments_change_continuously_through_a_frame(rigid):
    middle = float(rigid.times[1])
    at, step = rigid.at_time(middle), 1e-6
    for time in (middle - step, middle + step):
        near = rigid.at_time(time)
        assert near.observed == pytest.approx(at.observed, abs=1e-4)
        assert near.rotations == pytest.approx(at.rotations, abs=1e-4)


def test_distances_between_controls_are_the_largest_that_ever_occur():
    mesh = figure()
    found = measured(mesh, [mesh.vertices, mesh.vertices * [2, 1, 1], mesh.vertices * 0.5])
    largest = found.ever_apart
    stretched = found.observed[1].astype(np.float64)
    expected = np.linalg.norm(stretched[:, None] - stretched[None], axis=-1)
    # The expanded square loses half of the digits where two controls are close.
    assert largest == pytest.approx(expected, abs=2e-3)


def test_saved_controls_are_the_same_controls(rigid, tmp_path):
    rigid.save(tmp_path)
    loaded = RigidControls.load(tmp_path)
    for name in ("times", "canonical", "observed", "rotations", "surface", "surface_control"):
        assert np.array_equal(getattr(loaded, name), getattr(rigid, name))


def test_chosen_frames_keep_their_motion(rigid):
    chosen = rigid.frames(np.array([3, 1]))
    assert np.array_equal(chosen.observed, rigid.observed[[3, 1]])
    assert chosen.times.tolist() == rigid.times[[3, 1]].tolist()
