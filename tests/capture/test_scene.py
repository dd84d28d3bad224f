"""The scene reader: what it opens, and what it refuses with one line."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from tests.capsule_person import default_recipe, edit_description, write_scene


@pytest.fixture
def folder(tmp_path):
    return write_scene(tmp_path, default_recipe())


def refusal(folder, change) -> str:
    edit_description(folder, change)
    with pytest.raises(InputError) as refused:
        open_scene(folder)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def camera_change(key, value):
    def change(description):
        description["cameras"]["cam00"][key] = value

    return change


def test_a_scene_opens_with_its_cameras_and_its_up(folder):
    scene = open_scene(folder)
    assert list(scene.cameras) == ["cam00", "cam01"]
    assert scene.evaluation_cameras == ["cam01"]
    assert scene.up.tolist() == [0, 0, 1]
    assert scene.frames("cam00").indices.tolist() == list(range(6))


def test_another_camera_may_be_trained_on_and_the_former_one_evaluates(folder):
    scene = open_scene(folder, "cam01")
    assert scene.train_camera == "cam01"
    assert scene.evaluation_cameras == ["cam00"]
    known = scene.training_description()
    assert known["camera"] == scene.description.cameras["cam01"].model_dump()
    assert known["train_camera"] == "cam01"
    assert not any("cam00" in str(file.parent) for file in scene.source_files())
    assert open_scene(folder, "cam00").training_description() == (
        open_scene(folder).training_description()
    )


def test_a_camera_that_the_scene_does_not_have_cannot_be_trained_on(folder):
    with pytest.raises(InputError, match=r"'cam07' among cam00, cam01.*capture\.train_camera"):
        open_scene(folder, "cam07")


def test_a_camera_survives_the_file_exactly(folder):
    written = default_recipe().cameras["cam00"]
    read = open_scene(folder).cameras["cam00"]
    for name in ("K", "R", "t", "distortion"):
        assert np.array_equal(getattr(written, name), getattr(read, name))


def test_a_missing_scene_is_named(tmp_path):
    with pytest.raises(InputError, match="scene"):
        open_scene(tmp_path / "nowhere")


def test_a_matrix_that_is_no_rotation_is_refused(folder):
    assert "rotation" in refusal(folder, camera_change("R", (2 * np.eye(3)).tolist()))


def test_a_mirror_is_no_rotation(folder):
    mirror = np.diag([1.0, 1.0, -1.0]).tolist()
    assert "determinant" in refusal(folder, camera_change("R", mirror))


def test_non_finite_numbers_are_refused(folder):
    assert "finite" in refusal(folder, camera_change("t", [0.0, float("nan"), 1.0]))
    assert "finite" in refusal(folder, camera_change("K", [[1e400, 0, 1], [0, 1, 1], [0, 0, 1]]))


def test_intrinsics_without_a_focal_length_are_refused(folder):
    assert "fx, fy > 0" in refusal(folder, camera_change("K", [[0, 0, 1], [0, 1, 1], [0, 0, 1]]))


def test_a_matrix_of_another_shape_is_refused(folder):
    assert "3 x 3" in refusal(folder, camera_change("R", [[1, 0], [0, 1]]))


def test_a_misspelt_field_is_named(folder):
    assert "distorsion" in refusal(folder, camera_change("distorsion", [0.0] * 5))


def test_a_file_that_is_not_there_is_named(folder):
    assert "nothing at masks/lost" in refusal(folder, camera_change("masks", "masks/lost"))


def test_a_train_camera_that_does_not_exist_is_refused(folder):
    assert "cam07" in refusal(folder, lambda d: d.update(train_camera="cam07"))


def test_broken_json_is_refused(folder):
    (folder / "scene.json").write_text("{")
    with pytest.raises(InputError, match="JSON"):
        open_scene(folder)


def test_an_image_without_a_number_is_refused(folder):
    (folder / "frames" / "cam00" / "last.png").touch()
    with pytest.raises(InputError, match=r"last\.png"):
        open_scene(folder).frames("cam00")


def test_the_training_side_knows_no_other_camera_and_no_truth(folder):
    scene = open_scene(folder)
    assert "cam01" not in str(scene.training_description())
    assert not [file for file in scene.source_files() if "cam01" in str(file)]
    assert not [file for file in scene.evaluation_files() if "cam00" in str(file)]
    before = scene.training_description(), scene.source_files()
    edit_description(folder, lambda d: d["cameras"].pop("cam01"))
    after = open_scene(folder)
    assert (after.training_description(), after.source_files()) == before


def test_every_file_the_training_side_reads_is_listed_once(folder):
    files = open_scene(folder).source_files()
    assert len(files) == len(set(files)) == 6 + 6 + 1 + 1
