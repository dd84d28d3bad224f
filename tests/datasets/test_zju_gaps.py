"""What is missing in a ZJU-MoCap folder is left out and said, not failed over."""

from __future__ import annotations

import pytest
from numpy.testing import assert_allclose

from mocoflow_core.datasets.zju_mocap import ZjuMocapConfig, read_zju_mocap
from mocoflow_core.errors import InputError
from tests.datasets.studio import Z_DOWN, studio
from tests.datasets.zju_layout import AS_RELEASED, NAMES_313, ZjuLayout, write_faces, write_zju

NAMES = ("Camera_B1", "Camera_B2", "Camera_B3")
OLD_ONLY = ZjuLayout(body_folders=("vertices",))


@pytest.fixture(scope="module")
def filmed():
    return studio(NAMES, Z_DOWN)


@pytest.fixture
def read(tmp_path, filmed):
    """Write a variant of the layout, take files away, read it."""

    def write_and_read(layout=AS_RELEASED, without=(), name="CoreView_377", **settings):
        folder = write_zju(tmp_path / name, filmed, layout)
        for pattern in without:
            files = list(folder.glob(pattern))
            assert files
            for file in files:
                file.unlink()
        faces = write_faces(tmp_path / "smpl.obj", filmed)
        return read_zju_mocap(folder, ZjuMocapConfig(**{"faces": faces} | settings))

    return write_and_read


def said(scene, words):
    return any(words in remark for remark in scene.remarks)


def train_frames(scene):
    return scene.cameras[scene.train_camera].frames.indices.tolist()


def test_frames_without_a_body_file_are_no_failure(read):
    scene = read(without=["new_vertices/2.npy"])
    assert train_frames(scene) == [0, 1, 2, 3, 4, 5]
    assert scene.meshes.sequence.frame_indices.tolist() == [0, 1, 3, 4, 5]
    assert said(scene, "1 of 6 frames have no file in new_vertices")


def test_the_clip_ends_where_the_bodies_do(read):
    scene = read(without=["new_vertices/0.npy", "new_vertices/5.npy"])
    assert train_frames(scene) == [1, 2, 3, 4]
    assert scene.cameras["Camera_B2"].frames.indices.tolist() == [1, 3]
    assert said(scene, "it holds frames 1 to 4")


def test_a_mask_missing_in_one_folder_is_taken_from_the_other(read, filmed):
    scene = read(without=["mask_cihp/Camera_B1/000003.png"])
    assert train_frames(scene) == [0, 1, 2, 3, 4, 5]
    ((_, mask),) = scene.cameras["Camera_B1"].masks.read([3])
    assert (mask == filmed.masks["Camera_B1"][3]).all()


def test_a_train_frame_without_any_mask_cuts_the_clip(read):
    scene = read(without=["mask*/Camera_B1/000001.png"])
    assert train_frames(scene) == [2, 3, 4, 5]
    assert said(scene, "1 pictures lack their mask")


def test_evaluation_frames_without_a_mask_are_skipped(read):
    scene = read(without=["mask*/Camera_B2/000002.png", "Camera_B3/000004.jpg"])
    assert scene.cameras["Camera_B2"].masks.indices.tolist() == [0, 4]
    assert scene.cameras["Camera_B3"].frames.indices.tolist() == [0, 2]
    assert said(scene, "1 of 3 masks of Camera_B2 are missing")
    assert said(scene, "1 of 3 pictures of Camera_B3 are missing")


def test_a_camera_without_pictures_is_left_out(read):
    scene = read(without=["Camera_B2/*.jpg"])
    assert list(scene.cameras) == ["Camera_B1", "Camera_B3"]
    assert said(scene, "Camera_B2 is left out")


def test_a_clip_outside_the_folder_says_what_there_is(read):
    with pytest.raises(InputError, match="pictures 0 to 5"):
        read(name="CoreView_390")


def test_the_usual_clip_of_396_keeps_its_own_numbers(read, filmed):
    layout = ZjuLayout(first_number=810)
    scene = read(layout, name="CoreView_396")
    assert train_frames(scene) == list(range(810, 816))
    assert_allclose(scene.meshes.sequence.vertices, filmed.meshes.vertices)


def test_copies_of_396_that_number_bodies_from_0_need_an_offset(read, filmed):
    layout = ZjuLayout(first_number=810, body_number_offset=-810)
    with pytest.raises(InputError, match="body_number_offset"):
        read(layout, name="CoreView_396")


def test_copies_of_396_are_read_with_their_offset(read, filmed):
    layout = ZjuLayout(first_number=810, body_number_offset=-810)
    scene = read(layout, name="CoreView_396", body_number_offset=-810)
    assert scene.meshes.sequence.frame_indices.tolist() == list(range(810, 816))
    assert_allclose(scene.meshes.sequence.vertices, filmed.meshes.vertices)


def test_new_vertices_are_preferred_to_old_ones(read):
    scene = read(ZjuLayout(body_folders=("vertices", "new_vertices")))
    assert said(scene, "bodies are those of new_vertices")
    assert not said(scene, "blend shapes")


def test_old_vertices_are_taken_with_a_warning(read):
    scene = read(OLD_ONLY)
    assert said(scene, "without the pose blend shapes of SMPL, unlike new_vertices")


def test_vertices_without_faces_say_where_faces_come_from(read):
    with pytest.raises(InputError, match=r"consensus\.obj.*--body-model"):
        read(faces=None)


def test_without_bodies_a_scene_needs_neither_faces_nor_model(read):
    scene = read(faces=None, bodies="none")
    assert scene.meshes is None


def test_no_bodies_at_all_says_what_can_be_done(read):
    with pytest.raises(InputError, match="bodies to none"):
        read(ZjuLayout(body_folders=()))


def test_313_counts_from_1_in_pictures_masks_and_bodies(tmp_path):
    filmed = studio(NAMES_313, Z_DOWN, frames=3, width=32, height=48)
    layout = ZjuLayout(nested_lists=True, time_stamped=True, first_number=1)
    folder = write_zju(tmp_path / "CoreView_313", filmed, layout)
    faces = write_faces(tmp_path / "smpl.obj", filmed)
    scene = read_zju_mocap(folder, ZjuMocapConfig(faces=faces))
    assert scene.train_camera == "Camera_1"
    assert len(scene.cameras) == 21
    assert train_frames(scene) == [1, 2, 3]
    assert scene.source_begins_at == 1
    assert scene.meshes.sequence.frame_indices.tolist() == [1, 2, 3]
    assert_allclose(scene.cameras["Camera_22"].camera.t, filmed.cameras["Camera (22)"].t)
