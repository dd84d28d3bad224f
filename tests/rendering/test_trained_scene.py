from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from mocoflow_core.rendering.trained_scene import TrainedScene
from tests.capsule_person import look_at
from tests.toy_training import SCHEDULE, Prepared

GREY = 0.35


@pytest.fixture(scope="module")
def scene(trained) -> TrainedScene:
    return TrainedScene.open(trained)


def grey(camera) -> np.ndarray:
    return np.full((camera.height, camera.width, 3), GREY, np.float32)


def test_a_scene_opens_from_its_folder_alone_and_renders_the_same(prepared, trained, tmp_path):
    alone = tmp_path / "elsewhere"
    shutil.copytree(trained, alone)
    shutil.rmtree(alone / "snapshots")
    camera = prepared.clip.camera
    torch.manual_seed(1)
    first = TrainedScene.open(trained).render(camera, 0.4)
    torch.manual_seed(2)
    moved = TrainedScene.open(alone)
    for _ in range(2):
        again = moved.render(camera, 0.4)
        assert np.array_equal(first[0], again[0])
        assert np.array_equal(first[1], again[1])


def test_a_snapshot_opens_like_the_trained_scene(prepared, trained, scene):
    weights = trained / "snapshots" / f"{SCHEDULE.joint_steps:06d}.safetensors"
    snapshot = TrainedScene.open(trained, weights)
    camera = prepared.clip.camera
    assert np.array_equal(snapshot.render(camera, 0.0)[0], scene.render(camera, 0.0)[0])


@pytest.mark.parametrize("name", ["model.safetensors", "shape.json", "density.safetensors"])
def test_a_missing_part_is_an_error_never_a_start_from_scratch(trained, tmp_path, name):
    broken = tmp_path / "broken"
    shutil.copytree(trained, broken)
    (broken / name).unlink()
    with pytest.raises(FileNotFoundError):
        TrainedScene.open(broken)


def test_where_no_body_is_the_background_shows_exactly(prepared, scene):
    camera = prepared.clip.camera
    rng = np.random.default_rng(0)
    background = rng.random((camera.height, camera.width, 3)).astype(np.float32)
    rgb, opacity = scene.render(camera, 0.2, background)
    empty = opacity == 0
    assert 0.3 < empty.mean() < 0.95
    assert np.array_equal(rgb[empty], background[empty])
    away = look_at([0, -3, 1], [0, -9, 1], 40.0, 32, 32)
    rgb, opacity = scene.render(away, 0.2, background)
    assert np.array_equal(rgb, background)
    assert not opacity.any()


def test_the_given_background_is_left_untouched_and_white_is_the_default(prepared, scene):
    camera = prepared.clip.camera
    background = grey(camera)
    scene.render(camera, 0.0, background)
    assert (background == np.float32(GREY)).all()
    rgb, opacity = scene.render(camera, 0.0)
    assert (rgb[opacity == 0] == 1.0).all()


@pytest.mark.parametrize("time", [0.0, 0.13, 0.5, 1.0])
@pytest.mark.parametrize("eye", [(0, -3, 1.2), (3, 0.5, 1.2), (0, 0.3, 0.9), (0, -40, 1)])
def test_opacity_and_colour_stay_in_their_range_from_anywhere(scene, time, eye):
    camera = look_at(eye, [0, 0, 0.85], 40.0, 32, 32)
    rgb, opacity = scene.render(camera, time, grey(camera))
    assert rgb.dtype == opacity.dtype == np.float32
    assert ((opacity >= 0) & (opacity <= 1)).all()
    assert ((rgb >= 0) & (rgb <= 1 + 1e-5)).all()


def test_colours_are_composited_over_whatever_is_behind(prepared, scene):
    camera = prepared.clip.camera
    black, opacity = scene.render(camera, 0.4, 0 * grey(camera))
    over, again = scene.render(camera, 0.4, grey(camera))
    assert np.array_equal(opacity, again)
    assert over == pytest.approx(black + GREY * (1 - opacity[..., None]), abs=1e-6)


def test_the_person_stands_where_the_masks_are(prepared: Prepared, scene):
    clip = prepared.clip
    for row in range(len(clip.times)):
        _, opacity = scene.render(clip.camera, float(clip.times[row]))
        shown, mask = opacity > 0.5, clip.masks[row]
        # Pixels are as wide as an arm's half here.
        assert (shown & mask).sum() / (shown | mask).sum() > 0.75, row


def test_time_goes_on_between_frames(prepared, scene):
    camera = prepared.clip.camera
    at, just_after, later = (scene.render(camera, time)[1] for time in (0.41, 0.4101, 0.55))
    assert np.abs(just_after - at).max() < 0.05
    assert np.abs(later - at).max() > 0.2


def test_times_beyond_the_clip_show_its_ends(prepared, scene):
    camera = prepared.clip.camera
    assert np.array_equal(scene.render(camera, -2.0)[0], scene.render(camera, 0.0)[0])
    assert np.array_equal(scene.render(camera, 7.0)[0], scene.render(camera, 1.0)[0])


def test_a_part_of_the_picture_is_the_picture_s_part(prepared, scene):
    # Rays do not know of each other.
    camera = prepared.clip.camera
    K = camera.K.copy()
    K[:2, 2] -= [10, 6]
    window = replace(camera, width=14, height=20, K=K)
    whole, opacity = scene.render(camera, 0.3)
    rgb, part = scene.render(window, 0.3)
    # Painted discs may give a pixel another start, and so other places in the same density.
    assert part == pytest.approx(opacity[6:26, 10:24], abs=0.15)
    assert np.abs(part - opacity[6:26, 10:24]).mean() < 0.01
    assert np.abs(rgb - whole[6:26, 10:24]).mean() < 0.01


def test_a_single_pixel_is_a_picture(scene):
    camera = look_at([0, -3, 1.2], [0, 0, 1.1], 40.0, 1, 1)
    rgb, opacity = scene.render(camera, 0.0)
    assert rgb.shape == (1, 1, 3)
    assert opacity[0, 0] > 0.9


def test_a_body_that_moves_through_the_world_is_rendered_where_it_is(prepared, scene):
    # Novel views use world coordinates: camera and body moved together show the same.
    camera = prepared.clip.camera
    shifted = replace(camera, t=camera.t + camera.R @ np.array([0.5, 0.0, 0.0]))
    _, here = scene.render(camera, 0.0)
    _, there = scene.render(shifted, 0.0)
    assert here.sum() > 20
    assert np.abs(here - there).max() > 0.5
