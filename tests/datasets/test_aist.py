"""Writing AIST's layout and reading it gives the same cameras, pixels and masks."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.datasets.aist import read_aist
from mocoflow_core.datasets.aist_configuration import AistConfig
from mocoflow_core.errors import InputError
from mocoflow_core.metrics.mask_iou import mask_iou
from tests.datasets.aist_layout import SEQUENCE, AistLayout, write_aist
from tests.datasets.studio import CLOTHES, Y_UP, studio

NAMES = ("c01", "c05", "c07", "c08", "c09")
FRAMES = 20


@pytest.fixture(scope="module")
def filmed():
    return studio(NAMES, Y_UP, frames=FRAMES)


@pytest.fixture(scope="module")
def usual(tmp_path_factory, filmed):
    """The layout without a motion, as distributed otherwise; no test changes it."""
    return write_aist(tmp_path_factory.mktemp("aist"), filmed, None)


def read(folder, **settings):
    return read_aist(folder, AistConfig(bodies="none", **settings))


def frames_of(camera):
    return dict(camera.frames.read(camera.frames.indices.tolist()))


def said(scene, words):
    return any(words in remark for remark in scene.remarks)


def test_cameras_are_those_that_were_written(usual, filmed):
    scene = read(usual)
    assert set(scene.cameras) == set(NAMES)
    for name, camera in filmed.cameras.items():
        found = scene.cameras[name].camera
        for part in ("K", "R", "t", "distortion"):
            np.testing.assert_allclose(getattr(found, part), getattr(camera, part), atol=1e-9)


def test_pixels_are_those_that_were_filmed(usual, filmed):
    scene = read(usual)
    for name, camera in scene.cameras.items():
        wanted = filmed.frames(name)
        for number, image in frames_of(camera).items():
            assert np.abs(image.astype(int) - wanted[number]).mean() < 6  # H.264 at 64 pixels.


def test_the_plate_is_the_room_without_the_person(usual, filmed):
    """From in front: from the side the person walks towards the camera and stays in the picture."""
    plate = read(usual).cameras["c01"].background
    assert np.abs(plate.astype(int) - filmed.plates["c01"]).mean() < 5


def test_masks_are_where_frames_differ_from_the_plate(usual, filmed):
    camera = read(usual).cameras["c01"]
    for number, mask in camera.masks.read(camera.frames.indices.tolist()):
        assert mask_iou(mask, filmed.masks["c01"][number]) > 0.75


@pytest.mark.parametrize(("background", "behind"), [("plate", "plate"), ("filmed", "kept")])
def test_the_scene_says_what_the_person_is_set_before(usual, background, behind):
    assert read(usual, background=background).behind_person == behind


def test_c09_trains_on_every_frame_and_others_evaluate_on_every_fifth(usual):
    scene = read(usual)
    assert (scene.train_camera, scene.fps, scene.working_fps) == ("c09", 60, 12)
    assert scene.cameras["c09"].frames.indices.tolist() == list(range(FRAMES))
    assert scene.cameras["c01"].frames.indices.tolist() == [0, 5, 10, 15]


def test_c01_trains_when_it_is_chosen_and_a_range_can_be(usual):
    scene = read(usual, train_camera="c01", evaluation_cameras=("c09",), first_frame=3, frames=11)
    assert list(scene.cameras) == ["c01", "c09"]
    assert scene.cameras["c01"].frames.indices.tolist() == list(range(3, 14))
    assert scene.cameras["c09"].frames.indices.tolist() == [3, 8, 13]


def test_a_range_beyond_the_recording_is_refused(usual):
    with pytest.raises(InputError, match="recording of 20 frames"):
        read(usual, first_frame=30)


def test_up_is_where_the_cameras_say(usual):
    scene = read(usual)
    assert scene.up == "+y"
    assert said(scene, "up is +y: the mean up of the cameras")


def test_one_video_names_its_sequence(usual):
    video = usual / f"videos/{SEQUENCE.replace('cAll', 'c01')}.mp4"
    assert read(video).name == SEQUENCE


def test_of_several_sequences_one_must_be_named(tmp_path, filmed):
    write_aist(tmp_path, filmed, None)
    video = next((tmp_path / "videos").iterdir())
    video.with_name("gBR_sBM_c01_d04_mBR0_ch01.mp4").write_bytes(video.read_bytes())
    with pytest.raises(InputError, match="field sequence"):
        read(tmp_path)
    assert read(tmp_path, sequence=SEQUENCE.replace("cAll", "c05")).name == SEQUENCE


def test_folders_can_be_named(usual, tmp_path):
    scene = read(tmp_path, videos=usual / "videos", annotations=usual / "annotations")
    assert scene.name == SEQUENCE


def test_annotations_that_are_nowhere_are_asked_for(tmp_path):
    (tmp_path / "gBR_sBM_c01_d04_mBR0_ch01.mp4").touch()
    with pytest.raises(InputError, match=r"cameras/mapping\.txt"):
        read(tmp_path)


def test_missing_views_are_tolerated_and_told(tmp_path, filmed):
    scene = read(write_aist(tmp_path, filmed, None, layout=AistLayout(missing_videos=("c05",))))
    assert set(scene.cameras) == set(NAMES) - {"c05"}
    assert said(scene, "gWA_sFM_c05_d27_mWA5_ch20 is not there")


@pytest.mark.parametrize(
    ("sequence", "camera"),
    [("gMH_sBM_cAll_d23_mMH1_ch05", "c08"), ("gMH_sBM_cAll_d22_mMH2_ch01", "c09")],
)
def test_the_two_videos_that_were_never_released_are_known(tmp_path, filmed, sequence, camera):
    layout = AistLayout(sequence=sequence, missing_videos=(camera,))
    scene = read(write_aist(tmp_path, filmed, None, layout=layout), train_camera="c01")
    assert said(scene, f"{sequence.replace('cAll', camera)} was never released")


def test_without_the_train_video_those_present_are_told(tmp_path, filmed):
    folder = write_aist(tmp_path, filmed, None, layout=AistLayout(missing_videos=("c09",)))
    with pytest.raises(InputError, match="videos of c01, c05, c07, c08"):
        read(folder)


@pytest.mark.parametrize(
    ("sequence", "camera"),
    [("gBR_sBM_cAll_d04_mBR0_ch01", "c05"), ("gJB_sBM_cAll_d07_mJB3_ch05", "c07")],
    ids=["not synchronised", "640 x 480"],
)
def test_views_known_to_be_wrong_are_left_out(tmp_path, filmed, sequence, camera):
    folder = write_aist(tmp_path, filmed, None, layout=AistLayout(sequence=sequence))
    scene = read(folder)
    assert set(scene.cameras) == set(NAMES) - {camera}
    assert said(scene, f"{sequence.replace('cAll', camera)} is left out")
    assert set(read(folder, left_out_views=()).cameras) == set(NAMES)


def test_ignored_sequences_are_refused_unless_asked_for(tmp_path, filmed):
    layout = AistLayout(ignored=(f"{SEQUENCE} ",))
    folder = write_aist(tmp_path, filmed, None, layout=layout)
    with pytest.raises(InputError, match=r"ignore_list\.txt"):
        read(folder)
    assert said(read(folder, ignore_list="warn"), "known to be wrong")


def test_smaller_videos_scale_the_calibration_and_say_so(tmp_path, filmed):
    scene = read(write_aist(tmp_path, filmed, None, layout=AistLayout(shrunk_to=(32, 48))))
    camera = scene.cameras["c09"].camera
    assert (camera.width, camera.height) == (32, 48)
    np.testing.assert_allclose(camera.K[:2], filmed.cameras["c09"].K[:2] / 2)
    assert said(scene, "scaled to 32 pixels")


def test_a_video_of_another_shape_is_refused(tmp_path, filmed):
    folder = write_aist(tmp_path, filmed, None, layout=AistLayout(shrunk_to=(96, 48)))
    with pytest.raises(InputError, match="left_out_views"):
        read(folder)


def test_videos_not_quite_at_60_come_onto_the_grid_and_say_so(tmp_path, filmed):
    scene = read(write_aist(tmp_path, filmed, None, layout=AistLayout(fps=60000 / 1001)))
    assert said(scene, "59.94 frames per second: sampled on the 60 Hz grid")
    assert scene.cameras["c09"].frames.indices.tolist() == list(range(FRAMES))


def test_a_users_masks_are_taken_by_the_frames_of_the_video(usual, filmed, tmp_path):
    for name in NAMES:
        folder = tmp_path / SEQUENCE.replace("cAll", name)
        folder.mkdir()
        for number, mask in enumerate(filmed.masks[name]):
            cv2.imwrite(str(folder / f"{number:06d}.png"), mask.astype(np.uint8) * 255)
    scene = read(usual, masks=tmp_path)
    camera = scene.cameras["c09"]
    for number, mask in camera.masks.read([0, 7]):
        np.testing.assert_array_equal(mask, filmed.masks["c09"][number])
    clothes = [image[filmed.masks["c09"][number]] for number, image in camera.frames.read([0, 7])]
    assert np.abs(np.concatenate(clothes).astype(int).mean(axis=0) - CLOTHES).max() < 40
    assert said(scene, "masks are the user's")


def test_masks_that_are_not_there_are_told_by_the_videos_name(usual, tmp_path):
    with pytest.raises(InputError, match="gWA_sFM_c09_d27_mWA5_ch20"):
        read(usual, masks=tmp_path)
