from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocoflow_core.body.motion_checks import (
    check_agreement,
    check_frozen,
    check_turns,
    turns_deg,
)
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.capture.clip import Clip
from tests.capsule_person import capsule_person, look_at, walking

FRAMES = 8
CAMERA = look_at([0.3, -3.0, 1.3], [0, 0, 0.9], 150, 128, 128)
MESHES = walking(FRAMES)


def clip_of(masks) -> Clip:
    count = len(masks)
    nothing = np.zeros(count, bool)
    return Clip(
        CAMERA,
        12.0,
        MESHES.frame_indices,
        np.zeros((count, 1, 1, 3), np.uint8),
        masks,
        ~nothing,
        nothing,
        np.zeros((1, 1, 3), np.uint8),
    )


def repeated(rows: slice):
    vertices = MESHES.vertices.copy()
    vertices[rows] = vertices[rows.start]
    return replace(MESHES, vertices=vertices)


def test_a_walk_is_neither_frozen_nor_flipped():
    assert check_frozen(MESHES) == check_turns(MESHES) == ()


def test_repeated_meshes_are_named_by_their_frames():
    (words,) = check_frozen(repeated(slice(2, 6)))
    assert "4 frames (2-5)" in words


def test_a_mesh_repeated_once_is_no_freeze():
    assert check_frozen(repeated(slice(2, 4))) == ()


def test_a_body_that_never_moves_is_a_still_one():
    assert check_frozen(repeated(slice(0, FRAMES))) == ()
    assert check_frozen(MESHES.at(MESHES.frame_indices[:1])) == ()


@pytest.mark.parametrize("degrees", [0.0, 30.0, 150.0, 180.0])
def test_turns_are_measured_whatever_the_body_does_besides(degrees):
    turns = np.radians([0.0, degrees])
    meshes = capsule_person(turns, [0.0, 0.2], np.array([[0, 0, 0], [0.5, 1.0, 0]]))
    # The arms that swing pull the whole body's rotation a little.
    assert turns_deg(meshes) == pytest.approx([degrees], abs=3.0)


def test_a_flip_is_named_with_its_angle_and_frame():
    vertices = MESHES.vertices.copy()
    half_turn = Rotation.from_euler("z", 180, degrees=True).as_matrix().astype(np.float32)
    middle = vertices[5:].mean(axis=1, keepdims=True)
    vertices[5:] = (vertices[5:] - middle) @ half_turn.T + middle
    (words,) = check_turns(replace(MESHES, vertices=vertices))
    assert "at frame 4" in words
    assert "1 above 90" in words


def test_a_mask_of_another_moment_fits_worse_than_the_others():
    masks = silhouettes(MESHES.vertices, MESHES.faces, CAMERA)
    assert check_agreement(clip_of(masks), MESHES) == ()
    masks[2] = masks[7]
    (words,) = check_agreement(clip_of(masks), MESHES)
    assert "frame 2" in words


def test_a_clip_without_any_mask_says_nothing():
    assert check_agreement(clip_of(np.zeros((FRAMES, 128, 128), bool)), MESHES) == ()
