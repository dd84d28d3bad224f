"""How much of the surface is never seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.planning.visibility import unseen_share, visibility_warnings

SIZE = 96


def ball_turning(angles_deg) -> tuple[Clip, MeshSequence]:
    """A ball of 0.3 m about 40 m away, where half of it is seen at a time, turning about y."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    angles = np.radians(angles_deg)
    turns = np.stack(
        [trimesh.transformations.rotation_matrix(a, [0, 1, 0])[:3, :3] for a in angles]
    )
    vertices = np.einsum("tij,vj->tvi", turns, ball.vertices) + np.array([0, 0, 40.0])
    count = len(angles)
    meshes = MeshSequence(
        np.arange(count, dtype=np.int32), vertices.astype(np.float32), ball.faces.astype(np.int32)
    )
    K = np.array([[4800.0, 0, SIZE / 2], [0, 4800.0, SIZE / 2], [0, 0, 1]])
    camera = Camera("front", SIZE, SIZE, K, np.eye(3), np.zeros(3))
    frames, masks = np.zeros((count, SIZE, SIZE, 3), np.uint8), np.ones((count, SIZE, SIZE), bool)
    flags = np.zeros(count, bool)
    clip = Clip(camera, 12.0, meshes.frame_indices, frames, masks, ~flags, flags, frames[0])
    return clip, meshes


# Vertices within 2 cm behind the outline's depth count as seen: 0.02 / 0.6 of the surface.
TOLERANCE = 0.04


def test_half_of_a_ball_is_seen_at_a_time():
    assert unseen_share(*ball_turning([0.0])) == pytest.approx(0.5, abs=TOLERANCE)


def test_a_half_turn_shows_the_rest():
    assert unseen_share(*ball_turning([0.0, 90.0, 180.0])) < TOLERANCE


def test_a_quarter_turn_shows_a_quarter_more():
    assert unseen_share(*ball_turning([0.0, 90.0])) == pytest.approx(0.25, abs=TOLERANCE)


def test_what_held_out_frames_show_does_not_count():
    clip, meshes = ball_turning([0.0, 90.0, 180.0])
    held_out = np.array([False, True, True])
    clip = replace(clip, held_out=held_out, has_mask=~held_out)
    assert unseen_share(clip, meshes) == pytest.approx(0.5, abs=TOLERANCE)


def test_a_body_outside_the_image_is_not_seen():
    clip, meshes = ball_turning([0.0, 90.0])
    beside = replace(meshes, vertices=meshes.vertices + np.float32([5.0, 0.0, 0.0]))
    assert unseen_share(clip, beside) == 1.0


def test_an_unseen_part_is_warned_of_with_its_share():
    (warning,) = visibility_warnings(0.31, "cam00")
    assert "31 %" in warning
    assert "cam00" in warning
    assert visibility_warnings(0.05, "cam00") == ()
