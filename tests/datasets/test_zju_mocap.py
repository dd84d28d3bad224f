"""Writing ZJU-MoCap's layout and reading it gives the same cameras, bodies and pixels."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.frame_source import ImageFrames
from mocoflow_core.datasets.zju_mocap import ZjuMocapConfig, read_zju_mocap
from mocoflow_core.errors import InputError
from tests.datasets.studio import Z_DOWN, bent, studio
from tests.datasets.zju_layout import AS_RELEASED, ZjuLayout, write_faces, write_zju

NAMES = ("Camera_B1", "Camera_B2", "Camera_B7")
DISTORTION = [-0.05, 0.02, 0.001, -0.002, 0.003]


@pytest.fixture(scope="module")
def filmed():
    return bent(studio(NAMES, Z_DOWN), DISTORTION)


@pytest.fixture(scope="module")
def faces(tmp_path_factory, filmed):
    return write_faces(tmp_path_factory.mktemp("faces") / "smpl.obj", filmed)


@pytest.fixture
def read(tmp_path, filmed, faces):
    """Write a variant of the layout, change it, read it."""

    def write_and_read(layout=AS_RELEASED, change=None, name="CoreView_377", **settings):
        folder = write_zju(tmp_path / name, filmed, layout)
        if change:
            change(folder)
        return read_zju_mocap(folder, ZjuMocapConfig(faces=faces, **settings))

    return write_and_read


def assert_same_cameras(scene, filmed):
    assert list(scene.cameras) == list(filmed.cameras)
    for name, camera in filmed.cameras.items():
        found = scene.cameras[name].camera
        for part in ("K", "R", "t", "distortion"):
            np.testing.assert_allclose(getattr(found, part), getattr(camera, part), atol=1e-9)
        assert (found.width, found.height) == (camera.width, camera.height)


def test_cameras_bodies_and_pixels_are_those_that_were_written(read, filmed):
    scene = read()
    assert_same_cameras(scene, filmed)
    np.testing.assert_allclose(scene.meshes.sequence.vertices, filmed.meshes.vertices, atol=1e-6)
    np.testing.assert_array_equal(scene.meshes.sequence.faces, filmed.meshes.faces)
    assert (scene.meshes.coordinates, scene.meshes.located) == ("world", True)
    for name, camera in scene.cameras.items():
        numbers = camera.frames.indices.tolist()
        masks, frames = filmed.masks[name][numbers], filmed.frames(name)[numbers]
        assert isinstance(camera.frames, ImageFrames)  # As they are, to be linked.
        for (_, mask), wanted in zip(camera.masks.read(numbers), masks, strict=True):
            np.testing.assert_array_equal(mask, wanted)
        for (_, frame), wanted in zip(camera.frames.read(numbers), frames, strict=True):
            assert np.abs(frame.astype(int) - wanted).mean() < 2  # JPEG.


@pytest.mark.parametrize(("background", "behind"), [("white", "white"), ("filmed", "kept")])
def test_the_scene_says_what_the_person_is_set_before(read, background, behind):
    scene = read(background=background)
    assert scene.behind_person == behind
    assert scene.cameras["Camera_B1"].background is None


@pytest.mark.parametrize(
    "layout",
    [
        ZjuLayout(nested_lists=True),
        ZjuLayout(keypoints=True),
        ZjuLayout(annotations="annots_python2.npy"),
        ZjuLayout(annotations="annots_python2.npy", nested_lists=True, keypoints=True),
        ZjuLayout(annotations="annots.json"),
    ],
    ids=["nested lists", "with kpts2d", "python 2", "python 2 with lists", "json"],
)
def test_variants_of_the_annotations_mean_the_same(read, filmed, layout):
    assert_same_cameras(read(layout), filmed)


def test_camera_b1_trains_and_all_others_evaluate_on_the_working_frames(read):
    scene = read()
    assert scene.train_camera == "Camera_B1"
    assert scene.cameras["Camera_B1"].frames.indices.tolist() == [0, 1, 2, 3, 4, 5]
    assert scene.cameras["Camera_B7"].frames.indices.tolist() == [0, 2, 4]
    assert (scene.fps, scene.working_fps) == (24, 12)


@pytest.mark.parametrize("wanted", ["Camera_B2", "B2", "2"])
def test_another_camera_can_train_by_any_spelling(read, wanted):
    scene = read(train_camera=wanted, evaluation_cameras=("B7",))
    assert scene.train_camera == "Camera_B2"
    assert list(scene.cameras) == ["Camera_B2", "Camera_B7"]


def test_a_camera_that_is_not_there_is_told_with_those_that_are(read):
    with pytest.raises(InputError, match="Camera_B1, Camera_B2, Camera_B7"):
        read(train_camera="B3")


def test_up_is_where_the_cameras_say_and_the_world_points_down(read):
    scene = read()
    assert scene.up == "-z"
    assert any("up is -z: the mean up of the cameras" in remark for remark in scene.remarks)


def test_a_body_in_metres_stands_three_metres_from_cameras_in_millimetres(read):
    scene = read()
    middle = scene.meshes.sequence.vertices.mean(axis=(0, 1))
    distance = np.linalg.norm(scene.cameras["Camera_B1"].camera.to_camera(middle))
    assert distance == pytest.approx(3.6, abs=0.3)


def test_translations_in_metres_are_refused_unless_they_are_said_to_be(read):
    with pytest.raises(InputError, match="camera_unit"):
        read(ZjuLayout(unit_m=1.0))


def test_translations_in_metres_are_taken_when_they_are_said_to_be(read, filmed):
    assert_same_cameras(read(ZjuLayout(unit_m=1.0), camera_unit="metres"), filmed)


def test_pictures_of_another_size_than_their_masks_are_refused(read):
    def shrink(folder):
        file = folder / "mask/Camera_B1/000000.png"
        cv2.imwrite(str(file), cv2.imread(str(file))[::2, ::2])

    scene = read(change=shrink)
    with pytest.raises(InputError, match="64 x 96"):
        list(scene.cameras["Camera_B1"].masks.read([0]))


def test_the_cameras_that_evaluate_have_no_say_in_what_is_up(read, tmp_path):
    folder = tmp_path / "CoreView_377"
    read()
    chosen = {
        read_zju_mocap(folder, ZjuMocapConfig(bodies="none", evaluation_cameras=others)).remarks[-1]
        for others in ((), ("B2",), ("B7",), None)
    }
    [remark] = chosen
    assert remark.startswith("up is -z")
