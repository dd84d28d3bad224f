from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.strange_frames import listed, measure_frames, sound_clip
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


HELD_OUT = np.arange(FRAMES) % 3 == 1
HELD_OUT_BESIDE = np.isin(np.arange(FRAMES), [5, 7])
SPOILT_MASKS = np.zeros((SIDE, SIDE), bool), np.ones((SIDE, SIDE), bool)


@pytest.mark.parametrize("mask", SPOILT_MASKS, ids=["empty", "full"])
@pytest.mark.parametrize("broken_row", [None, 3, 6])
def test_nothing_in_held_out_frames_changes_what_is_said_of_training_frames(clip, mask, broken_row):
    if broken_row is not None:
        clip = with_frame(clip, broken_row, clip.frames[11])
        clip.masks[broken_row] = False
    clip = replace(clip, held_out=HELD_OUT)
    frames, masks = clip.frames.copy(), clip.masks.copy()
    frames[HELD_OUT], masks[HELD_OUT] = 255 - frames[HELD_OUT], mask
    spoilt = replace(clip, frames=frames, masks=masks)
    assert _believed(clip) == _believed(spoilt)
    before, after = measure_frames(clip, THRESHOLD), measure_frames(spoilt, THRESHOLD)
    for name in ("changed", "surplus", "detour"):
        ours, theirs = getattr(before, name), getattr(after, name)
        assert ours[~HELD_OUT].tolist() == theirs[~HELD_OUT].tolist()


def _believed(clip) -> dict[int, bool]:
    """The training frames that stay, and whether their masks are believed."""
    found = sound_clip(clip, THRESHOLD)[0]
    training = ~found.held_out
    numbers, masks = found.frame_indices[training], found.has_mask[training]
    return dict(zip(numbers.tolist(), masks.tolist(), strict=True))


def test_a_mask_that_jumps_between_held_out_ones_that_jump_too_is_named(clip):
    masks = clip.masks.copy()
    masks[5:8, 32:] = False
    masks[5:8, :26] = False
    _, warnings = sound_clip(replace(clip, masks=masks, held_out=HELD_OUT_BESIDE), THRESHOLD)
    assert any("frame 12 of cam with a mask of another size" in words for words in warnings)


def test_held_out_frames_alone_break_no_plate(clip):
    held_out = np.arange(FRAMES) < 3
    frames = clip.frames.copy()
    frames[:3] = 255
    found, warnings = sound_clip(replace(clip, frames=frames, held_out=held_out), THRESHOLD)
    assert found.frame_indices.tolist() == clip.frame_indices[3:].tolist()
    assert not any("differ from the background" in words for words in warnings)


def test_numbers_are_listed_in_runs():
    assert listed([7]) == "frame 7"
    assert listed([3, 4, 5, 9]) == "4 frames (3-5, 9)"
    assert listed(list(range(0, 20, 2))) == "10 frames (0, 2, 4, 6, 8, 10, ...)"
