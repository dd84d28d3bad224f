"""A bare video becomes a scene, or says in one line why it does not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.datasets.bare_video import read_bare_video
from mocoflow_core.datasets.detect import kind_of
from mocoflow_core.datasets.kinds import KINDS
from mocoflow_core.errors import InputError
from mocoflow_core.io.video import write_video
from mocoflow_core.video.configuration import VideoConfig
from tests.lossless_video import write_lossless
from tests.one_thread import one_thread  # noqa: F401
from tests.squat_pictures import squat_pictures

# A quarter of the video's size: enough for one who fills the picture.
SIZE = (180, 320)
QUICK = VideoConfig(bodies="none", plate_frames=4, working_fps=5)


def small(picture):
    return cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA)


PERSON = [small(picture) for picture in squat_pictures()]
MOVING = [PERSON[row] for row in (0, 1, 2, 1, 0, 1, 2, 1, 0, 1)]


def written(path, pictures, fps=10):
    write_video(path, pictures, fps)
    return path


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("video")
    return read_bare_video(written(folder / "friend.mp4", MOVING), QUICK)


def test_a_video_becomes_a_scene_with_masks_plate_and_camera(scene):
    camera = scene.cameras[scene.train_camera]
    assert scene.name == "friend"
    assert (scene.fps, scene.working_fps, scene.up) == (pytest.approx(10), 5, "-y")
    assert camera.frames.indices.tolist() == camera.masks.indices.tolist() == list(range(10))
    assert (camera.camera.width, camera.camera.height) == SIZE
    assert camera.background.shape == (320, 180, 3)
    for _, mask in camera.masks.read([0, 9]):
        assert 0.08 < mask.mean() < 0.25
        assert mask[90:230, 62:88].mean() > 0.7


def test_what_was_assumed_is_said(scene):
    said = "\n".join((*scene.remarks, *scene.caveats))
    for words in ("10 frames, 10 per second", "one person", "background moves"):
        assert words in said
    assert any("the focal length is guessed" in caveat for caveat in scene.caveats)
    assert "--meshes" in said


def test_a_file_is_a_video_and_a_folder_is_none(tmp_path):
    file = tmp_path / "film.mov"
    file.touch()
    assert kind_of("auto", file) is KINDS["video"]
    with pytest.raises(InputError, match="known data set") as refused:
        kind_of("auto", tmp_path)
    assert "video lacks" not in str(refused.value)


def test_a_text_is_no_video(tmp_path):
    (tmp_path / "film.mp4").write_text("no film")
    with pytest.raises(InputError, match="must be a video that can be decoded"):
        read_bare_video(tmp_path / "film.mp4", QUICK)


def test_a_frame_that_may_be_held_out_reaches_nothing_that_is_learned_from(tmp_path, scene):
    held_out = (1, 3, 5, 7)
    other = [
        np.maximum(picture, 120) if row in held_out else picture
        for row, picture in enumerate(MOVING)
    ]
    made = []
    for name, pictures in (("film", MOVING), ("other", other)):
        film = tmp_path / f"{name}.mp4"
        write_lossless(film, pictures, 10)
        made.append(read_bare_video(film, QUICK).cameras["camera"])
    one, two = made
    np.testing.assert_array_equal(one.background, two.background)
    masks = [dict(camera.masks.read(range(10))) for camera in made]
    for row in set(range(10)) - set(held_out):
        np.testing.assert_array_equal(masks[0][row], masks[1][row])
    assert any((masks[0][row] != masks[1][row]).any() for row in held_out)
    assert "made from 6 frames; 4 between them may be held out" in "".join(scene.remarks)
