from __future__ import annotations

import numpy as np

from mocoflow_core.synthetic.clothing import Outfit
from mocoflow_core.synthetic.scene_writer import perform


def test_loose_clothes_stand_off_the_skin_by_centimetres_and_sway(small_turn, person):
    outfit = Outfit(person, seed=0)
    offsets = np.stack([outfit.stand_off(time) for time in (0.0, 0.05)])
    assert offsets.min() >= 0
    assert 0.03 < offsets.max() < 0.06
    dressed = offsets[0] > 0.01
    assert dressed.mean() > 0.15
    assert 0.002 < np.abs(offsets[1] - offsets[0])[dressed].max() < 0.03


def test_loose_clothes_change_the_surface_but_not_the_keypoints(small_turn, person):
    _, tight = perform(small_turn, person)
    _, loose = perform(small_turn.model_copy(update={"clothing": "loose"}), person)
    moved = np.linalg.norm(loose.vertices - tight.vertices, axis=-1)
    assert 0.03 < moved.max() < 0.06
    assert np.array_equal(loose.keypoints3d, tight.keypoints3d)


def test_colours_are_reflectances_and_follow_the_seed(person):
    outfit, other = Outfit(person, seed=0), Outfit(person, seed=1)
    points = person.rest_vertices[person.outer_faces].mean(axis=1).astype(np.float32)
    colours = outfit.albedo(points, outfit.face_limbs)
    assert colours.min() >= 0
    assert colours.max() < 1.3
    assert np.array_equal(colours, outfit.albedo(points, outfit.face_limbs))
    assert not np.array_equal(colours, other.albedo(points, other.face_limbs))
