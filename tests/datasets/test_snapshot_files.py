"""The single files of a People-Snapshot subject: their types, and what is refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from mocoflow_core.datasets.hdf5_masks import Hdf5Masks
from mocoflow_core.datasets.snapshot_files import (
    find_paths,
    missing_parts,
    read_camera,
    read_consensus_body,
    read_tracked_body,
)
from mocoflow_core.errors import InputError
from tests.python2_pickle import python2_pickle

CAMERA = {
    "camera_f": np.array([2100.0, 2110.0]),
    "camera_c": np.array([540.0, 538.0]),
    "camera_k": np.array([-0.1, 0.2, 0.001, 0.002, 0.0]),
    "camera_t": np.zeros(3),
    "camera_rt": np.zeros(3),
    "width": 1080,
    "height": 1080,
}


@pytest.fixture
def camera_file(tmp_path):
    def write(**changes):
        file = tmp_path / "camera.pkl"
        values = {**CAMERA, **changes}
        kept = {key: value for key, value in values.items() if value is not None}
        file.write_bytes(python2_pickle(kept))
        return file

    return write


def refusal(read, *arguments) -> str:
    with pytest.raises(InputError) as refused:
        read(*arguments)
    return str(refused.value)


def test_pixel_centres_move_from_integers_to_halves(camera_file):
    camera = read_camera(camera_file(), "camera")
    assert camera.K.tolist() == [[2100, 0, 540.5], [0, 2110, 538.5], [0, 0, 1]]
    assert camera.distortion.tolist() == CAMERA["camera_k"].tolist()
    assert (camera.width, camera.height) == (1080, 1080)


def test_numbers_in_a_row_or_column_are_the_same(camera_file):
    column = camera_file(camera_f=np.array([[2100.0], [2110.0]]), width=np.array([1080]))
    assert read_camera(column, "camera").K[1, 1] == 2110


def test_a_camera_that_is_not_the_world_is_taken_as_it_says(camera_file):
    turned = camera_file(camera_rt=np.array([np.pi, 0, 0]), camera_t=np.array([0, 0.1, 2]))
    camera = read_camera(turned, "camera")
    assert np.allclose(camera.R, np.diag([1, -1, -1]))
    assert camera.t.tolist() == [0, 0.1, 2]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"camera_k": None}, "must hold 'camera_k'"),
        ({"camera_f": np.array([2100.0])}, "'camera_f' of camera.pkl must be 2 finite numbers"),
        ({"camera_c": np.array([np.nan, 0])}, "not finite"),
        ({"camera_t": "here"}, "'camera_t'"),
        ({"width": 0}, "must state a size"),
    ],
)
def test_a_camera_without_its_numbers_is_refused(camera_file, changes, reason):
    assert reason in refusal(read_camera, camera_file(**changes), "camera")


def test_a_camera_that_is_no_dictionary_is_refused(tmp_path):
    (tmp_path / "camera.pkl").write_bytes(python2_pickle([1, 2]))
    assert "must hold a dictionary" in refusal(read_camera, tmp_path / "camera.pkl", "camera")


def test_a_consensus_has_an_offset_for_each_vertex(tmp_path):
    file = tmp_path / "consensus.pkl"
    file.write_bytes(python2_pickle({"betas": np.ones((1, 10)), "v_personal": np.ones((6890, 3))}))
    consensus = read_consensus_body(file)
    assert consensus.shape.shape == (10,)
    assert consensus.offsets.shape == (6890, 3)


def test_poses_are_24_joints_and_must_be_finite(tmp_path):
    file = tmp_path / "reconstructed_poses.hdf5"
    with h5py.File(file, "w") as written:
        written["pose"] = np.arange(144, dtype=np.float32).reshape(2, 72)
        written["trans"] = np.zeros((2, 3), np.float32)
        written["betas"] = np.zeros(10, np.float32)
    tracked = read_tracked_body(file)
    assert tracked.pose[1, 0].tolist() == [72, 73, 74]
    with h5py.File(file, "a") as written:
        written["pose"][1, 5] = np.inf
    assert "'pose' of reconstructed_poses.hdf5" in refusal(read_tracked_body, file)


def test_masks_of_small_signed_numbers_do_not_overflow(tmp_path):
    shown = np.random.default_rng(0).random((30, 40, 50)) < 0.5
    with h5py.File(tmp_path / "masks.hdf5", "w") as file:
        file.create_dataset("masks", data=shown.astype(np.int8), compression="lzf")
    masks = Hdf5Masks(tmp_path / "masks.hdf5")
    assert masks.shape == (30, 40, 50)
    for number, mask in masks.read([29, 3, 4]):
        assert mask.dtype == bool
        assert np.array_equal(mask, shown[number])


@pytest.mark.parametrize("name", ["masks", "other"])
def test_masks_that_are_no_whole_numbers_are_refused(tmp_path, name):
    with h5py.File(tmp_path / "masks.hdf5", "w") as file:
        file[name] = np.zeros((2, 4, 4), np.float32)
    assert "whole numbers" in refusal(lambda: Hdf5Masks(tmp_path / "masks.hdf5").shape)


def test_missing_parts_are_named(tmp_path):
    folder = tmp_path / "male-1-sport"
    folder.mkdir()
    (folder / "camera.pkl").touch()
    (folder / "masks.hdf5").touch()
    assert "without <folder's name>.mp4, reconstructed_poses.hdf5" in refusal(find_paths, folder)


def test_the_video_has_the_folders_name_or_is_the_only_one(tmp_path):
    folder = tmp_path / "male-1-sport"
    folder.mkdir()
    for name in ("camera.pkl", "masks.hdf5", "reconstructed_poses.hdf5", "a.mp4"):
        (folder / name).touch()
    assert find_paths(folder).video.name == "a.mp4"
    (folder / "b.mp4").touch()
    assert missing_parts(folder) == ["<folder's name>.mp4"]
    (folder / "male-1-sport.mp4").touch()
    assert find_paths(folder).video.name == "male-1-sport.mp4"
