from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.body.facing import frames_that_show, shown_share, turned_away_warning
from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.capture.scene import open_scene
from tests.capsule_person import capsule_person, default_recipe, write_scene

CAMERA = default_recipe().cameras["cam00"]


def turning(degrees, places=None) -> IngestedMeshes:
    count = len(degrees)
    places = np.zeros((count, 3)) if places is None else places
    return IngestedMeshes(capsule_person(np.radians(degrees), [0] * count, places), "world", True)


def test_the_first_frame_shows_all_of_itself_and_the_opposite_side_next_to_nothing():
    shares = shown_share(turning([0, 90, 180, 360]), CAMERA)
    assert shares[0] == 1.0
    assert 0.3 < shares[1] < 0.7
    assert shares[2] < 0.15
    assert shares[3] == pytest.approx(1.0, abs=0.01)


def test_it_falls_from_the_front_to_the_back():
    shares = shown_share(turning(range(0, 181, 30)), CAMERA)
    assert (np.diff(shares) < 0).all()


def test_whatever_comes_first_is_the_front():
    other = shown_share(turning([180, 0]), CAMERA)
    assert other[0] == 1.0
    assert other[1] < 0.15


def test_a_body_of_another_topology_or_winding_shows_as_much():
    body = turning([0, 60, 120])
    faces = body.meshes.faces[:, ::-1]
    flipped = replace(body, meshes=replace(body.meshes, faces=faces))
    assert np.allclose(shown_share(flipped, CAMERA), shown_share(body, CAMERA))


def test_a_body_without_a_location_is_judged_by_its_direction():
    world = turning([0, 60, 120, 180])
    vertices = world.meshes.vertices.astype(float) @ CAMERA.R.T
    centred = (vertices - vertices.mean(axis=1, keepdims=True)).astype(np.float32)
    rootless = IngestedMeshes(replace(world.meshes, vertices=centred), "camera-root-centred", False)
    assert np.allclose(shown_share(rootless, CAMERA), shown_share(world, CAMERA), atol=0.12)


def test_the_frames_that_show_enough_are_named_by_their_numbers(tmp_path):
    body = turning([0, 45, 180, 350])
    recipe = replace(default_recipe(), meshes=body.meshes)
    folder = write_scene(tmp_path / "scene", recipe)
    ingested = tmp_path / "ingested"
    ingested.mkdir()
    body.save(ingested)
    scene = open_scene(folder)
    assert frames_that_show(ingested, scene, 0.5).tolist() == [0, 1, 3]
    assert frames_that_show(ingested, scene, 0.0).tolist() == [0, 1, 2, 3]


def test_frames_that_are_not_looked_at_are_counted_in_words():
    assert turned_away_warning(8, 8, 0.5) == ()
    [sentence] = turned_away_warning(5, 8, 0.5)
    assert "3 of 8 frames" in sentence
    assert "50 %" in sentence
