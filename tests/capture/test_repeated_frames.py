"""Frames that show nothing new, with and without the camera's noise."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.capture.repeated_frames import repeated_frames
from tests.capsule_person import room

SIZE = 48
ALL = np.ones(8, bool)


def filmed(places, noise: float = 0.0):
    """A square person at columns ``places`` of a room, and its masks."""
    masks = np.zeros((len(places), SIZE, SIZE), bool)
    for row, place in enumerate(places):
        masks[row, 10:40, place : place + 12] = True
    person = room(SIZE, SIZE, 5)
    frames = np.where(masks[..., None], [_shifted(person, p) for p in places], room(SIZE, SIZE))
    grain = np.random.default_rng(0).normal(0, 1, frames.shape)
    return (frames + noise * grain).round().clip(0, 255).astype(np.uint8), masks


def _shifted(person, place):
    return np.roll(person, place, axis=1)


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_frames_of_a_person_standing_still_repeat_the_first_of_them(noise):
    frames, masks = filmed([2, 2, 2, 8, 9, 9, 14, 14], noise)
    repeated = repeated_frames(frames, masks, ALL)
    # The last one is kept: it ends the clip.
    assert repeated.tolist() == [False, True, True, False, False, True, False, False]


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_person_that_moves_by_a_pixel_a_frame_repeats_nothing(noise):
    frames, masks = filmed(range(2, 10), noise)
    assert not repeated_frames(frames, masks, ALL).any()


def test_slow_changes_add_up_until_they_show():
    frames, masks = filmed([4] * 8)
    for row in range(8):
        # A fifth of the person gets brighter by one step with each frame: 0.2 on the mean.
        frames[row, 10:16, 4:16] = 100 + row
    # One step alone is rounding, two are not.
    expected = [False, True, False, True, False, True, False, False]
    assert repeated_frames(frames, masks, ALL).tolist() == expected


def test_frames_that_are_held_out_are_never_left_out():
    frames, masks = filmed([2] * 8)
    working = np.arange(8) % 2 == 0
    repeated = repeated_frames(frames, masks, working)
    assert not repeated[~working].any()
    assert repeated.tolist() == [False, False, True, False, True, False, False, False]


@pytest.mark.parametrize("count", [1, 2])
def test_the_shortest_clips_keep_all_their_frames(count):
    frames, masks = filmed([2] * count)
    assert not repeated_frames(frames, masks, np.ones(count, bool)).any()


def test_nobody_in_sight_is_compared_as_a_whole():
    frames, masks = filmed([2] * 4)
    assert repeated_frames(frames, masks & False, np.ones(4, bool)).tolist() == [
        False,
        True,
        True,
        False,
    ]


def test_a_black_frame_repeats_nothing():
    frames, masks = filmed([2] * 4)
    frames[2] = 0
    assert not repeated_frames(frames, masks, np.ones(4, bool))[2:].any()


def test_a_screen_that_flickers_behind_the_person_hides_no_movement():
    frames, masks = filmed([4] * 8)
    frames = np.minimum(frames, 200)
    for row in range(8):
        frames[row][masks[row]] += np.uint8(5 * row)
        frames[row, :, 30:] = 140 if row % 2 else 117
    assert not repeated_frames(frames, masks, ALL).any()
