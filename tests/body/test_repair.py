from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from mocoflow_core.body.articulation import articulate
from mocoflow_core.body.joint_correction import JointCorrection
from mocoflow_core.body.mask_misfit import (
    MaskMisfit,
    MaskMisfitConfig,
    expected_share,
    project,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import interpolate, rasterise
from mocoflow_core.body.repair import RepairConfig, RoundsConfig, outlines_apart, repair_body
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera

FRAMES, SIZE, HINGE = 8, 96, 0.15
HELD_OUT = np.arange(FRAMES) == 3
CONFIGURATION = RepairConfig(
    parts=6,
    by_masks=RoundsConfig(rounds=8, steps=10, rate=0.15, outlier_m=(0.08, 0.02)),
    by_both=RoundsConfig(rounds=2, steps=10, rate=0.1, outlier_m=(0.02, 0.02)),
)


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


def painted(meshes: MeshSequence) -> Clip:
    """Stripes around and along the limb, which move with its skin; no light but the even one."""
    rest = limb(np.zeros(1)).vertices[0]
    around, along = 3 * np.arctan2(rest[:, 2], rest[:, 0]), 12 * rest[:, 1]
    waves = np.stack([np.sin(around + along), np.sin(around - along), np.cos(around)], -1)
    colours = 128 + 100 * waves
    frames = [
        interpolate(rasterise(posed, meshes.faces, camera()), meshes.faces, colours)
        for posed in meshes.vertices
    ]
    return replace(filmed(meshes), frames=np.round(frames).astype(np.uint8))


def twisted(meshes: MeshSequence, angles: np.ndarray) -> MeshSequence:
    """Every frame (T,) turned about its own long axis, which no outline shows."""
    turns = Rotation.from_rotvec(angles[:, None] * [0.0, 1.0, 0.0])
    turned = [turn.apply(posed) for turn, posed in zip(turns, meshes.vertices, strict=True)]
    return replace(meshes, vertices=np.asarray(turned, np.float32))


def silent(fraction: float, what: str) -> None:
    """Progress that nobody watches."""


def fitted(clip: Clip, meshes: MeshSequence) -> np.ndarray:
    apart_px = outlines_apart(clip, meshes, CONFIGURATION)
    expected = expected_share(apart_px, CONFIGURATION.masks)
    return repair_body(clip, meshes, expected, CONFIGURATION, silent).vertices


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


def test_what_gives_the_same_picture_costs_the_same_near_and_far(
    truth: MeshSequence, bent: MeshSequence
) -> None:
    rows = np.arange(FRAMES)
    masks = MaskMisfit(filmed(truth), rows, rows, truth.faces, CONFIGURATION.masks)
    skeleton = articulate(bent.vertices, bent.faces, parts=6, blend_m=0.04)
    usual = np.full(len(skeleton.parents), 0.1)
    correction = JointCorrection(skeleton, bent.vertices, np.eye(FRAMES), usual, 1.0, 1.0, 0.02)
    targets = masks.look(correction)
    given = masks(correction, targets, 0.08)
    towards_camera = camera().centre_world - skeleton.pivots[:, 0]
    with torch.no_grad():
        correction.size.fill_(np.log(0.9))
        correction.shifts.copy_(torch.from_numpy(0.1 * towards_camera))
    # Sums of float32 over a thousand points.
    moved = masks(correction, targets, 0.08)
    assert moved.item() == pytest.approx(given.item(), rel=1e-4)


def test_clothes_move_an_outline_by_less_the_farther_away_they_are(truth: MeshSequence) -> None:
    rows = np.arange(FRAMES)
    masks = MaskMisfit(filmed(truth), rows, rows, truth.faces, CONFIGURATION.masks)
    skeleton = articulate(truth.vertices, truth.faces, parts=6, blend_m=0.04)
    usual = np.full(len(skeleton.parents), 0.1)
    correction = JointCorrection(skeleton, truth.vertices, np.eye(FRAMES), usual, 1.0, 1.0, 0.02)
    targets = masks.look(correction)
    on_the_masks = replace(targets, pixels=project(camera(), targets.places)[0])
    away = camera().centre_world - skeleton.pivots[:, 0]
    with torch.no_grad():
        correction.clothes.fill_(1.0)
        # The same picture from twice as far: 2 cm of clothes show like 1 cm on the estimate.
        correction.size.fill_(np.log(2.0))
        correction.shifts.copy_(torch.from_numpy(-away))
    usual_misfit = 0.5 * CONFIGURATION.masks.independent_points / 0.02**2
    # Of every point, as their shares of a frame sum to one; 0.08 m saturate far beyond it.
    expected = usual_misfit * len(rows) * 0.01**2 / (1 + (0.01 / 0.08) ** 2)
    found = masks(correction, on_the_masks, 0.08)
    assert found.item() == pytest.approx(expected, rel=0.01)


def test_where_no_error_is_expected_the_estimate_is_left_as_it_came(
    truth: MeshSequence, bent: MeshSequence
) -> None:
    apart_px = outlines_apart(filmed(truth), bent, CONFIGURATION)
    assert expected_share(apart_px, CONFIGURATION.masks) > 0
    assert expected_share(CONFIGURATION.masks.agreeing_px, CONFIGURATION.masks) == 0
    assert repair_body(filmed(truth), bent, 0.0, CONFIGURATION, silent) is bent


def test_clothes_that_stand_off_one_part_are_no_error_of_the_estimate(truth: MeshSequence) -> None:
    clip = filmed(truth)
    kernel = np.ones((7, 7), np.uint8)
    masks = clip.masks.copy()
    half = SIZE // 2
    for mask in masks:
        mask[half:] = cv2.dilate(mask.astype(np.uint8), kernel)[half:] > 0
    rows = np.arange(FRAMES)
    misfit = MaskMisfit(replace(clip, masks=masks), rows, rows, truth.faces, CONFIGURATION.masks)
    # y points down: the lower half of the picture shows the vertices of larger y.
    dressed = (truth.vertices[0, :, 1] > 0).astype(np.int64)
    whole = misfit.apart_px(truth.vertices, np.zeros_like(dressed))
    assert misfit.apart_px(truth.vertices, dressed) < 0.5 * whole


def test_thresholds_out_of_order_are_refused() -> None:
    with pytest.raises(ValueError, match="below apart_px"):
        MaskMisfitConfig(agreeing_px=2.0, apart_px=1.5)


def test_colours_find_the_twist_that_outlines_do_not_show(
    truth: MeshSequence, bent: MeshSequence
) -> None:
    # The error changes over the clip: one that all frames share only renames the skin's points.
    wrong = twisted(bent, np.linspace(-0.15, 0.15, FRAMES))
    clip = painted(truth)
    blind = CONFIGURATION.model_copy(
        update={"colours": CONFIGURATION.colours.model_copy(update={"independent_points": 0})}
    )

    lower = truth.vertices[0, :, 1] < HINGE - 0.3

    def twist(vertices: np.ndarray) -> float:
        """How far the lower half's turn about the long axis changes over the clip, radians."""
        (x, _, z), (u, _, w) = (v[:, lower].transpose(2, 0, 1) for v in (truth.vertices, vertices))
        return float(np.arctan2((x * w - z * u).sum(1), (x * u + z * w).sum(1)).std())

    long = CONFIGURATION.model_copy(update={"by_both": RepairConfig().by_both})
    by_masks, by_both = (
        repair_body(clip, wrong, 1.0, configuration, silent).vertices
        for configuration in (blind, long)
    )
    assert twist(by_masks) > 0.5 * twist(wrong.vertices)
    assert twist(by_both) < 0.3 * twist(wrong.vertices)


def test_one_colour_everywhere_changes_little(
    truth: MeshSequence, bent: MeshSequence, repaired: np.ndarray
) -> None:
    clip = filmed(truth)
    grey = replace(clip, frames=np.full_like(clip.frames, 128))
    # Half a pixel at this distance is 8 mm.
    assert np.abs(fitted(grey, bent) - repaired).mean() < 0.008


def test_a_body_that_is_too_small_is_made_larger_where_it_stands():
    right = limb(np.radians(np.linspace(-20, 20, FRAMES)))
    centre = right.vertices.mean(axis=(0, 1))
    small = replace(right, vertices=(centre + (right.vertices - centre) / 1.08).astype(np.float32))
    found = fitted(filmed(right), small)
    height, wanted = (np.ptp(v[..., 1], axis=1).mean() for v in (found, right.vertices))
    assert height == pytest.approx(wanted, rel=0.02)  # clothes explain some of it
    assert abs((found - right.vertices)[..., 2].mean()) < 0.02  # metres along the sight


def test_a_size_that_is_wrong_by_little_is_taken_for_right():
    right = limb(np.radians(np.linspace(-20, 20, FRAMES)))
    centre = right.vertices.mean(axis=(0, 1))
    small = replace(right, vertices=(centre + (right.vertices - centre) / 1.015).astype(np.float32))
    found = repair_body(filmed(right), small, 1.0, CONFIGURATION, silent).vertices
    across = np.linalg.norm(np.ptp(found, axis=1), axis=-1).mean()
    given = np.linalg.norm(np.ptp(small.vertices, axis=1), axis=-1).mean()
    assert across == pytest.approx(given, rel=0.005)


def test_a_place_that_was_searched_may_err_by_more_and_says_nothing_of_the_size():
    usual, searched = RepairConfig(), RepairConfig().after_search()
    assert searched.root_error_m > 2 * usual.root_error_m
    assert (usual.size_error > 0, searched.size_error) == (True, 0)
