from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.strange_frames import listed, sound_clip
from mocoflow_core.geometry.camera import Camera

FRAMES, SIDE = 12, 64
THRESHOLD = 30


@pytest.fixture
def clip() -> Clip:
    """A striped disc that walks slowly past a textured wall."""
    generator = np.random.default_rng(0)
    wall = generator.integers(60, 200, (SIDE, SIDE, 3), dtype=np.uint8)
    frames, masks = np.repeat(wall[None], FRAMES, axis=0), np.zeros((FRAMES, SIDE, SIDE), np.uint8)
    for row in range(FRAMES):
        cv2.circle(masks[row], (16 + 3 * row, 32), 10, 255, -1)
        frames[row][masks[row] > 0] = (230, 20, 20)
        frames[row][:, 16 + 3 * row][masks[row][:, 16 + 3 * row] > 0] = (20, 20, 230)
    camera = Camera("cam", SIDE, SIDE, np.eye(3), np.eye(3), np.zeros(3))
    return Clip(
        camera,
        12.0,
        2 * np.arange(FRAMES, dtype=np.int32),
        frames,
        masks > 0,
        np.ones(FRAMES, bool),
        np.zeros(FRAMES, bool),
        wall,
    )


def with_frame(clip: Clip, row: int, value) -> Clip:
    frames = clip.frames.copy()
    frames[row] = value
    return replace(clip, frames=frames)


def test_a_sound_clip_comes_back_as_it_is(clip):
    found, warnings = sound_clip(clip, THRESHOLD)
    assert found is clip
    assert warnings == ()


@pytest.mark.parametrize("value", [0, 255])
def test_a_frame_without_the_background_is_left_out_by_its_source_number(clip, value):
    found, warnings = sound_clip(with_frame(clip, 4, value), THRESHOLD)
    assert 8 not in found.frame_indices
    assert len(found.frames) == len(found.masks) == len(found.held_out) == FRAMES - 1
    assert "frame 8 of cam left out" in warnings[0]


def test_many_frames_that_differ_show_a_wrong_plate_and_all_stay(clip):
    found, warnings = sound_clip(replace(clip, background=255 - clip.background), THRESHOLD)
    assert len(found.frames) == FRAMES
    assert "12 of 12 frames differ from the background" in warnings[0]


def test_an_empty_mask_is_not_believed_where_somebody_is_seen(clip):
    masks = clip.masks.copy()
    masks[3:5] = False
    found, warnings = sound_clip(replace(clip, masks=masks), THRESHOLD)
    assert np.flatnonzero(~found.has_mask).tolist() == [3, 4]
    assert "2 frames (6, 8)" in warnings[0]
    assert "counted as without a mask" in warnings[0]


def test_an_empty_mask_of_an_empty_frame_is_believed(clip):
    masks = clip.masks.copy()
    masks[3] = False
    found, warnings = sound_clip(
        with_frame(replace(clip, masks=masks), 3, clip.background), THRESHOLD
    )
    assert found.has_mask.all()
    assert "frame 6 of cam with an empty mask: nobody" in warnings[0]


def test_a_frame_of_another_moment_shows_somebody_beside_the_mask(clip):
    _, warnings = sound_clip(with_frame(clip, 2, clip.frames[9]), THRESHOLD)
    assert any("frame 4 of cam showing more than mask and background" in w for w in warnings)


def test_a_frame_out_of_order_is_unlike_its_neighbours_even_with_its_own_mask(clip):
    masks = clip.masks.copy()
    masks[2] = masks[9]
    spoilt = with_frame(replace(clip, masks=masks), 2, clip.frames[9])
    assert any("frame 4 of cam unlike" in words for words in sound_clip(spoilt, THRESHOLD)[1])


def test_a_mask_that_jumps_in_size_is_named(clip):
    masks = clip.masks.copy()
    masks[6, 32:] = False
    masks[6, :26] = False
    _, warnings = sound_clip(replace(clip, masks=masks), THRESHOLD)
    assert any("frame 12 of cam with a mask of another size" in words for words in warnings)


def test_numbers_are_listed_in_runs():
    assert listed([7]) == "frame 7"
    assert listed([3, 4, 5, 9]) == "4 frames (3-5, 9)"
    assert listed(list(range(0, 20, 2))) == "10 frames (0, 2, 4, 6, 8, 10, ...)"
