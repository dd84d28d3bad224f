from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.synthetic.catalogue import SCENES, named_scene
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.scene_files import SceneFiles
from mocoflow_core.synthetic.scene_writer import write_scene
from mocoflow_core.synthetic.toy import ToyConfig, write_toy_scene


def _bytes(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_the_scene_is_complete_and_opens(turn_scene):
    scene = open_scene(turn_scene)
    assert scene.train_camera == "cam00"
    assert list(scene.cameras) == ["cam00", "cam01", "cam02"]
    files = set(_bytes(turn_scene))
    for camera in scene.cameras:
        assert f"background/{camera}.png" in files
        for frame in range(4):
            assert {f"frames/{camera}/{frame:06d}.png", f"masks/{camera}/{frame:06d}.png"} <= files
    assert len(files) == 3 * (1 + 2 * 4) + 3


def test_scene_json_states_the_format_the_world_and_the_meshes(turn_scene):
    description = json.loads((turn_scene / "scene.json").read_text())
    assert description["format"] == "mocoflow-scene"
    assert description["version"] == 1
    assert description["world"] == {"unit": "m", "up": "+z"}
    assert description["meshes"]["coordinates"] == "world"
    assert description["meshes"]["located"] is True
    for camera in description["cameras"].values():
        rotation = np.array(camera["R"])
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        assert camera["distortion"] == [0.0] * 5
        # Half the image size is the corner origin's principal point of a centred camera.
        assert camera["K"][0][2] == 48.0
        centre = -rotation.T @ camera["t"]
        assert np.hypot(*centre[:2]) == pytest.approx(3.0)


def test_the_train_camera_stands_in_front_and_every_camera_looks_at_the_person(turn_scene):
    scene = open_scene(turn_scene)
    front = scene.cameras["cam00"].centre_world
    assert front[:2] == pytest.approx([0, -3], abs=1e-9)
    with np.load(turn_scene / "truth.npz") as truth:
        middle = truth["keypoints3d"][:, 11:13].mean(axis=(0, 1)).astype(float)
    for camera in scene.cameras.values():
        assert np.abs(camera.project(middle) - 48).max() < 12


def test_truth_and_meshes_join_the_frames_by_number(turn_scene):
    meshes = MeshSequence.load(turn_scene / "meshes.npz")
    assert meshes.frame_indices.tolist() == [0, 1, 2, 3]
    with np.load(turn_scene / "truth.npz") as truth:
        assert truth["frame_indices"].tolist() == [0, 1, 2, 3]
        assert truth["keypoints3d"].shape == (4, 17, 3)
        assert truth["vertices"].dtype == np.float32
        assert truth["faces"].max() == truth["vertices"].shape[1] - 1


def test_the_same_configuration_gives_the_same_bytes(small_turn, turn_scene, tmp_path):
    write_scene(small_turn, tmp_path / "again")
    assert _bytes(tmp_path / "again") == _bytes(turn_scene)


def test_rootless_meshes_are_the_world_meshes_in_the_train_camera_minus_the_root(
    toy_scene, tmp_path
):
    write_toy_scene(tmp_path / "rootless", ToyConfig(located=False))
    description = json.loads((tmp_path / "rootless/scene.json").read_text())
    assert description["meshes"]["coordinates"] == "camera-root-centred"
    assert description["meshes"]["located"] is False
    world = MeshSequence.load(toy_scene / "meshes.npz")
    centred = MeshSequence.load(tmp_path / "rootless/meshes.npz")
    rotation = open_scene(tmp_path / "rootless").cameras["cam00"].R
    root = world.vertices - centred.vertices @ rotation
    # One translation per frame explains the whole mesh, and it is the hips' place.
    assert np.ptp(root, axis=1).max() < 1e-5
    hips = np.einsum("kv,tvd->tkd", world.keypoint_regressor, world.vertices)[:, 11:13]
    assert np.linalg.norm(root.mean(axis=1) - hips.mean(axis=1), axis=1).max() < 0.1


def test_progress_rises_to_one(tmp_path):
    seen = []
    tiny = ToyConfig(frames=2, width=16, height=16, cameras=1)
    write_toy_scene(tmp_path / "tiny", tiny, lambda fraction, text: seen.append(fraction))
    assert seen == [0.5, 1.0]


def test_a_folder_with_content_is_refused(small_turn, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="new or empty folder"):
        write_scene(small_turn, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_scenes_have_names_and_an_unknown_name_is_refused():
    assert named_scene("turn_noise6").joint_noise_deg == 6.0
    assert all(configuration.name == name for name, configuration in SCENES.items())
    with pytest.raises(InputError, match="Choose a motion"):
        named_scene("swim")


def test_a_scene_with_settings_is_called_as_it_is_written():
    scene = named_scene("turn_noise6,joint_noise_deg=3,seed=1")
    changes = {"name": "turn_noise6,joint_noise_deg=3,seed=1", "joint_noise_deg": 3.0, "seed": 1}
    assert scene == named_scene("turn_noise6").model_copy(update=changes)
    assert named_scene("turn,name=mine,frames=12").name == "mine"


@pytest.mark.parametrize(
    ("name", "because"),
    [
        ("turn,joint_noise=3", "joint_noise_deg"),
        ("turn,frames=0", "frames must be valid"),
        ("turn,name=a/b", "name must be valid"),
    ],
)
def test_a_setting_that_no_scene_has_is_refused(name, because):
    with pytest.raises(InputError, match=because):
        named_scene(name)


def test_an_unknown_field_is_refused():
    with pytest.raises(ValidationError):
        SyntheticConfig(colour="red")


def test_pictures_are_what_the_reader_expects(turn_scene):
    mask = cv2.imread(str(turn_scene / "masks/cam00/000000.png"), cv2.IMREAD_UNCHANGED)
    assert mask.shape == (96, 96)
    assert set(np.unique(mask)) == {0, 255}
    assert cv2.imread(str(turn_scene / "frames/cam00/000000.png")).shape == (96, 96, 3)


@pytest.mark.parametrize("name", ["scene.json", "meshes.npz", "truth.npz"])
def test_a_full_disk_is_bad_input_and_leaves_no_half_of_a_file(tmp_path, name):
    files = SceneFiles(tmp_path)
    (tmp_path / f".new.{name}").symlink_to("/dev/full")
    camera = Camera("cam00", 8, 8, np.eye(3), np.eye(3), np.zeros(3))
    points = np.zeros((1, 3, 3))
    numbers, faces = np.zeros(1, np.int32), np.array([[0, 1, 2]], np.int32)
    write = {
        "scene.json": lambda: files.write_description("turn", 12.0, [camera], True, ""),
        "meshes.npz": lambda: files.write_meshes(
            MeshSequence(numbers, points.astype(np.float32), faces)
        ),
        "truth.npz": lambda: files.write_truth(numbers, points, faces, points),
    }
    with pytest.raises(InputError, match="full disk"):
        write[name]()
    assert not list(tmp_path.iterdir())
