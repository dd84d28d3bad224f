from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.mask_fit import MaskFitConfig, expected_share, fit_to_masks, outlines_apart
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera

FRAMES, SIZE, HINGE = 8, 96, 0.15
HELD_OUT = np.arange(FRAMES) == 3
CONFIGURATION = MaskFitConfig(parts=6, rounds=8, steps=10)


def camera() -> Camera:
    K = np.array([[150.0, 0, SIZE / 2], [0, 150.0, SIZE / 2], [0, 0, 1]])
    return Camera("front", SIZE, SIZE, K, np.eye(3), np.array([0.0, 0.0, 2.5]))


def limb(angles: np.ndarray) -> MeshSequence:
    """A capsule along y whose upper half is turned about z by ``angles`` (T,) at the hinge."""
    capsule = trimesh.creation.capsule(height=1.0, radius=0.12, count=[12, 12])
    rest = capsule.subdivide().vertices[:, [0, 2, 1]] * [1, 1, -1]
    faces = capsule.subdivide().faces
    rest[:, 1] -= rest[:, 1].mean()
    share = np.clip((rest[:, 1] - HINGE) / 0.1 + 0.5, 0, 1)
    turn = angles[:, None] * share
    x, y = rest[:, 0], rest[:, 1] - HINGE
    bent = np.stack(
        [
            np.cos(turn) * x - np.sin(turn) * y,
            np.sin(turn) * x + np.cos(turn) * y + HINGE,
            np.broadcast_to(rest[:, 2], turn.shape),
        ],
        axis=-1,
    )
    indices = np.arange(len(angles), dtype=np.int32)
    return MeshSequence(indices, bent.astype(np.float32), faces.astype(np.int32))


def filmed(meshes: MeshSequence) -> Clip:
    masks = silhouettes(meshes.vertices, meshes.faces, camera())
    frames = np.zeros((FRAMES, SIZE, SIZE, 3), np.uint8)
    has_mask = np.ones(FRAMES, bool)
    return Clip(camera(), 12.0, meshes.frame_indices, frames, masks, has_mask, HELD_OUT, frames[0])


def fitted(clip: Clip, meshes: MeshSequence) -> np.ndarray:
    expected = expected_share(outlines_apart(clip, meshes, CONFIGURATION), CONFIGURATION)
    if expected == 0:
        return meshes.vertices
    return fit_to_masks(clip, meshes, expected, CONFIGURATION, lambda fraction, text: None).vertices


@pytest.fixture(scope="module")
def truth() -> MeshSequence:
    return limb(np.linspace(-0.5, 0.5, FRAMES))


@pytest.fixture(scope="module")
def bent() -> MeshSequence:
    return limb(np.linspace(-0.5, 0.5, FRAMES) + 0.25)


@pytest.fixture(scope="module")
def repaired(truth: MeshSequence, bent: MeshSequence) -> np.ndarray:
    return fitted(filmed(truth), bent)


def test_exact_estimate_stays_where_it_is(truth: MeshSequence) -> None:
    assert np.abs(fitted(filmed(truth), truth) - truth.vertices).max() < 0.003


def test_bent_limb_is_straightened_towards_the_masks(
    truth: MeshSequence, bent: MeshSequence, repaired: np.ndarray
) -> None:
    clip = filmed(truth)
    tip = truth.vertices[0, :, 1].argmax()
    before = np.linalg.norm(bent.vertices - truth.vertices, axis=-1)[:, tip]
    after = np.linalg.norm(repaired - truth.vertices, axis=-1)[:, tip]
    assert np.isfinite(repaired).all()
    assert (after < 0.5 * before).all()
    agreement = overlap(silhouettes(repaired, bent.faces, clip.camera), clip.masks)
    assert agreement.min() > 0.9


def test_limb_keeps_its_length(bent: MeshSequence, repaired: np.ndarray) -> None:
    edges = bent.faces[:, :2]

    def lengths(vertices: np.ndarray) -> np.ndarray:
        return np.linalg.norm(vertices[:, edges[:, 0]] - vertices[:, edges[:, 1]], axis=-1)

    change = lengths(repaired).sum(1) / lengths(bent.vertices).sum(1)
    np.testing.assert_allclose(change, 1.0, atol=0.03)


def test_fit_is_deterministic(
    truth: MeshSequence, bent: MeshSequence, repaired: np.ndarray
) -> None:
    np.testing.assert_array_equal(fitted(filmed(truth), bent), repaired)


def test_held_out_masks_do_not_matter(
    truth: MeshSequence, bent: MeshSequence, repaired: np.ndarray
) -> None:
    clip = filmed(truth)
    noisy = clip.masks.copy()
    noisy[HELD_OUT] = np.random.default_rng(0).random((HELD_OUT.sum(), SIZE, SIZE)) > 0.5
    replaced = replace(clip, masks=noisy)
    np.testing.assert_array_equal(fitted(replaced, bent), repaired)


def test_frame_without_mask_is_repaired_like_its_neighbours(
    truth: MeshSequence, bent: MeshSequence, repaired: np.ndarray
) -> None:
    before = np.abs(bent.vertices - truth.vertices)[HELD_OUT].mean()
    assert np.abs(repaired - truth.vertices)[HELD_OUT].mean() < 0.6 * before


def test_empty_masks_leave_the_estimate(truth: MeshSequence, bent: MeshSequence) -> None:
    clip = filmed(truth)
    empty = replace(clip, masks=np.zeros_like(clip.masks))
    np.testing.assert_array_equal(fitted(empty, bent), bent.vertices)


def test_masks_away_from_the_body_give_finite_meshes(
    truth: MeshSequence, bent: MeshSequence
) -> None:
    clip = filmed(truth)
    elsewhere = np.zeros_like(clip.masks)
    elsewhere[:, :3, :3] = True
    assert np.isfinite(fitted(replace(clip, masks=elsewhere), bent)).all()
