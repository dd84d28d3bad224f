"""The inspection measures what is unusual and says so with the value."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.scene import open_scene
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.planning.inspection import Inspection, inspect_scene
from tests.capsule_person import (
    capsule_person,
    default_recipe,
    edit_description,
    look_at,
    room,
    write_scene,
)


def inspected(folder) -> Inspection:
    scene = open_scene(folder)
    return inspect_scene(scene, ingest_meshes(scene))


@pytest.fixture
def folder(tmp_path):
    return write_scene(tmp_path, default_recipe())


def rewrite_frames(folder, change):
    for number, path in enumerate(sorted((folder / "frames/cam00").iterdir())):
        cv2.imwrite(str(path), change(number, cv2.imread(str(path))))


def test_a_sound_scene_has_no_warning(folder):
    inspection = inspected(folder)
    assert inspection.warnings == ()
    assert inspection.overlap > 0.98
    assert inspection.body_height_m == pytest.approx(1.77, abs=0.05)
    assert inspection.body_distance_m == pytest.approx(3.5, abs=0.3)
    assert inspection.background_motion_px < 0.05


def test_an_inspection_survives_as_json(folder):
    inspection = inspected(folder)
    assert Inspection.model_validate_json(inspection.model_dump_json()) == inspection


def test_a_moving_camera_is_warned_of_with_its_motion(tmp_path):
    # Large enough that patches fit beside the person.
    recipe = default_recipe(3, 192, 192)
    folder = write_scene(tmp_path, recipe)
    rewrite_frames(folder, lambda number, image: np.roll(image, 3 * number, axis=1))
    inspection = inspected(folder)
    assert inspection.background_motion_px > 2
    assert any("background moves" in warning for warning in inspection.warnings)


def test_meshes_off_by_a_frame_are_warned_of_with_the_shift(tmp_path):
    turns = 0.5 * np.arange(8)
    places = np.stack([0.15 * np.arange(8) - 0.5, 0 * turns, 0 * turns], axis=-1)
    recipe = replace(default_recipe(), meshes=capsule_person(turns, 0 * turns, places))
    folder = write_scene(tmp_path, recipe)
    late = np.concatenate([recipe.meshes.vertices[:1], recipe.meshes.vertices[:-1]])
    replace(recipe.meshes, vertices=late).save(folder / "meshes.npz")
    assert any("moved by +1 frame" in warning for warning in inspected(folder).warnings)


def test_another_persons_meshes_are_warned_of_with_the_overlap(folder):
    beside = default_recipe().meshes
    replace(beside, vertices=beside.vertices + np.float32([0.4, 0, 0])).save(folder / "meshes.npz")
    inspection = inspected(folder)
    assert inspection.overlap < 0.6
    assert any("overlap the masks" in warning for warning in inspection.warnings)


@pytest.mark.parametrize(("scale", "found"), [(1.5, "2.6"), (0.5, "0.8")])
def test_an_unusual_height_is_warned_of(folder, scale, found):
    meshes = default_recipe().meshes
    replace(meshes, vertices=meshes.vertices * np.float32(scale)).save(folder / "meshes.npz")
    assert any(f"{found}" in w and "tall" in w for w in inspected(folder).warnings)


def test_an_unusual_distance_is_warned_of(tmp_path):
    far = look_at([0, -30, 1.2], [0, 0, 0.9], 1200, 64, 96, "cam00")
    folder = write_scene(tmp_path, replace(default_recipe(), cameras={"cam00": far}))
    assert any("30" in warning and "in front" in warning for warning in inspected(folder).warnings)


def test_inverted_masks_are_warned_of_with_their_share(folder):
    for path in (folder / "masks/cam00").iterdir():
        cv2.imwrite(str(path), 255 - cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    assert any("masks cover" in warning for warning in inspected(folder).warnings)


def test_a_principal_point_outside_the_image_is_warned_of(folder):
    def change(description):
        description["cameras"]["cam00"]["K"][0][2] = 500.0

    edit_description(folder, change)
    scene = open_scene(folder)
    assert any("principal point" in warning for warning in inspect_scene(scene, None).warnings)


def test_a_focal_length_of_another_image_size_is_warned_of(folder):
    def change(description):
        K = description["cameras"]["cam00"]["K"]
        K[0][0], K[1][1] = 20 * K[0][0], 22 * K[1][1]

    edit_description(folder, change)
    warnings = inspect_scene(open_scene(folder), None).warnings
    assert any("degrees" in warning for warning in warnings)
    assert any("not square" in warning for warning in warnings)


def test_masks_of_frames_that_do_not_exist_are_warned_of(folder):
    masks = folder / "masks/cam00"
    (masks / "000006.png").write_bytes((masks / "000005.png").read_bytes())
    assert any("1 masks belong to no frame, the first 6" in w for w in inspected(folder).warnings)


def test_a_jump_to_another_place_is_warned_of(folder):
    meshes = default_recipe().meshes
    vertices = meshes.vertices.copy()
    vertices[3] += np.float32([1.5, 0, 0])
    replace(meshes, vertices=vertices).save(folder / "meshes.npz")
    assert any("m/s at frame 2" in warning for warning in inspected(folder).warnings)


def test_nothing_of_other_cameras_reaches_the_inspection(folder):
    before = inspected(folder)
    for path in (folder / "frames/cam01").iterdir():
        cv2.imwrite(str(path), room(64, 96, 9))
    edit_description(folder, lambda d: d["cameras"]["cam01"].update(t=[9.0, 9.0, 9.0]))
    assert inspected(folder) == before
    edit_description(folder, lambda d: d["cameras"].pop("cam01"))
    assert inspected(folder) == before
