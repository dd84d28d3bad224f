"""Data sets written as scene folders: what is in them comes back, whole or not at all."""

from __future__ import annotations

import os
from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.extract import CaptureConfig, extract_clip, extract_evaluation
from mocoflow_core.capture.frame_source import ImageFrames
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.datasets.dataset_scene import DatasetTruth
from mocoflow_core.datasets.write_dataset import write_dataset
from mocoflow_core.errors import InputError
from tests.datasets.in_memory import MemoryFrames, walking_dataset, with_camera


@pytest.fixture
def scene():
    return walking_dataset()


def pictures(scene, name="front"):
    return scene.cameras[name].frames.pictures


def test_frames_masks_and_plate_come_back_under_their_source_numbers(scene, tmp_path):
    write_dataset(scene, tmp_path / "scene")
    written = open_scene(tmp_path / "scene")
    for name, recorded in scene.cameras.items():
        frames = written.frames(name)
        assert frames.indices.tolist() == list(range(20, 29))
        for number, image in frames.read(frames.indices.tolist()):
            assert np.array_equal(image, recorded.frames.pictures[number])
    clip = extract_clip(written, CaptureConfig(fps=24))
    assert np.array_equal(
        clip.masks, np.stack(list(scene.cameras["front"].masks.pictures.values()))
    )
    assert np.array_equal(clip.background, scene.cameras["front"].background)


def test_cameras_and_meshes_come_back(scene, tmp_path):
    write_dataset(scene, tmp_path / "scene")
    written = open_scene(tmp_path / "scene")
    for name, recorded in scene.cameras.items():
        assert written.cameras[name].to_json() == recorded.camera.to_json()
    with np.load(written.meshes()) as arrays:
        assert np.array_equal(arrays["vertices"], scene.meshes.sequence.vertices)
        assert np.array_equal(arrays["frame_indices"], scene.meshes.sequence.frame_indices)


def test_every_second_frame_is_learned_from_and_those_between_are_held_out(scene, tmp_path):
    write_dataset(scene, tmp_path / "scene")
    clip = extract_clip(open_scene(tmp_path / "scene"), CaptureConfig())
    assert clip.fps == 12.0
    assert clip.frame_indices[~clip.held_out].tolist() == [20, 22, 24, 26, 28]
    assert clip.frame_indices[clip.held_out].tolist() == [21, 23, 25, 27]


def test_a_stride_other_than_the_papers_rate_is_kept_and_can_be_overruled(scene, tmp_path):
    write_dataset(replace(scene, fps=30.0, working_fps=10.0), tmp_path / "scene")
    written = open_scene(tmp_path / "scene")
    clip = extract_clip(written, CaptureConfig(held_out_frames=0))
    assert clip.frame_indices.tolist() == [20, 23, 26]
    clip = extract_clip(written, CaptureConfig(held_out_frames=0, fps=15))
    assert clip.frame_indices.tolist() == [20, 22, 24, 26, 28]


def test_another_camera_may_have_gaps(scene, tmp_path):
    some = {number: image for number, image in pictures(scene, "side").items() if number % 3 == 0}
    write_dataset(with_camera(scene, "side", frames=MemoryFrames(some)), tmp_path / "scene")
    written = open_scene(tmp_path / "scene")
    clip = extract_clip(written, CaptureConfig())
    (other,) = extract_evaluation(written, clip.frame_indices, CaptureConfig())
    assert other.frame_indices.tolist() == [21, 24, 27]


def test_picture_files_to_which_nothing_is_done_keep_their_bytes(scene, tmp_path):
    files = {}
    for number, image in pictures(scene).items():
        files[number] = tmp_path / f"Anything (1)_{number:04d}_12.5.JPG"
        cv2.imwrite(str(files[number]), image)
    write_dataset(with_camera(scene, "front", frames=ImageFrames(files)), tmp_path / "scene")
    for number, file in files.items():
        target = tmp_path / "scene" / "frames" / "front" / f"{number:06d}.jpg"
        assert target.read_bytes() == file.read_bytes()
        assert target.samefile(file)  # No second copy on the same disk.


def test_a_linked_picture_is_followed(scene, tmp_path):
    (number, image), *_ = pictures(scene).items()
    cv2.imwrite(str(tmp_path / "there.png"), image)
    (tmp_path / "here.png").symlink_to("there.png")
    only = with_camera(scene, "front", frames=ImageFrames({number: tmp_path / "here.png"}))
    write_dataset(only, tmp_path / "far" / "away" / "scene")
    target = tmp_path / "far" / "away" / "scene" / "frames" / "front" / f"{number:06d}.png"
    assert target.read_bytes() == (tmp_path / "there.png").read_bytes()


def test_truth_keeps_what_is_known(scene, tmp_path):
    keypoints = np.full((9, 17, 3), np.nan, np.float32)
    truth = DatasetTruth(scene.meshes.sequence.frame_indices, keypoints3d=keypoints)
    write_dataset(replace(scene, truth=truth), tmp_path / "scene")
    with np.load(open_scene(tmp_path / "scene").truth()) as arrays:
        assert set(arrays.files) == {"frame_indices", "keypoints3d"}
        assert np.isnan(arrays["keypoints3d"]).all()


def test_a_folder_with_content_is_refused_and_left_alone(scene, tmp_path):
    (tmp_path / "note").write_text("mine")
    with pytest.raises(InputError, match="new or empty"):
        write_dataset(scene, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["note"]


def test_an_empty_folder_is_taken(scene, tmp_path):
    write_dataset(scene, tmp_path)
    assert open_scene(tmp_path).train_camera == "front"


def test_a_failure_on_the_way_leaves_nothing(scene, tmp_path):
    masks = MemoryFrames(dict(scene.cameras["front"].masks.pictures))
    masks.pictures[25] = None
    with pytest.raises(AttributeError):
        write_dataset(with_camera(scene, "front", masks=masks), tmp_path / "scene")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_named(scene, tmp_path):
    class Full(MemoryFrames):
        def read(self, wanted):
            raise OSError(28, os.strerror(28))

    with pytest.raises(InputError, match="full disk"):
        write_dataset(with_camera(scene, "side", frames=Full({20: None})), tmp_path / "scene")
    assert not list(tmp_path.iterdir())
