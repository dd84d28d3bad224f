"""Laws of the background plate."""

from __future__ import annotations

import numpy as np

from mocoflow_core.capture.background import (
    background_plate,
    covered_share,
    masks_from_plate,
    plate_without_masks,
)
from tests.capsule_person import room


def passing_square(steps=6, stride=5, size=48):
    plate = room(size, size)
    masks = np.zeros((steps, size, size), bool)
    for step in range(steps):
        masks[step, 10:30, 3 + stride * step : 15 + stride * step] = True
    frames = np.where(masks[..., None], np.uint8([250, 5, 5]), plate)
    return plate, masks, frames


def test_what_is_seen_once_is_in_the_plate_exactly():
    plate, masks, frames = passing_square()
    seen = ~masks.all(axis=0)
    assert np.array_equal(background_plate(frames, masks, 0)[seen], plate[seen])


def test_a_margin_keeps_the_rim_of_the_person_out():
    plate, masks, frames = passing_square(steps=2, stride=20)
    narrow = masks.copy()
    narrow[:, :, 1:-1] &= masks[:, :, 2:] & masks[:, :, :-2]
    assert not np.array_equal(background_plate(frames, narrow, 0), plate)
    assert np.array_equal(background_plate(frames, narrow, 2), plate)


def test_what_only_a_smaller_margin_shows_is_taken_with_that():
    plate, masks, frames = passing_square()
    assert np.array_equal(background_plate(frames, masks, 6), plate)


def test_what_is_never_seen_is_filled_from_around():
    frames = np.full((3, 20, 20, 3), 100, np.uint8)
    masks = np.zeros((3, 20, 20), bool)
    masks[:, 8:12, 8:12] = True
    frames[masks] = 255
    assert np.abs(background_plate(frames, masks, 0).astype(int) - 100).max() <= 2


def test_a_person_who_covers_a_pixel_most_of_the_time_leaves_no_trace():
    plate = room(24, 24)
    masks = np.zeros((10, 24, 24), bool)
    masks[:6, 6:18, 8:16] = True
    frames = np.where(masks[..., None], np.uint8([250, 5, 5]), plate)
    assert np.array_equal(background_plate(frames, masks, 2), plate)
    assert covered_share(masks) == 0
    masks[6:, 10, 10] = True
    assert covered_share(masks) == 1 / 24**2


def test_without_masks_what_passes_by_does_not_even_bias_the_plate():
    random = np.random.default_rng(0)
    steps, size = 15, 40
    plate = room(size, size).astype(float)
    frames = plate + random.normal(0, 6, (steps, size, size, 3))
    # Each pixel of the middle is covered by something bright in 6 of the 15 frames.
    for column in range(size):
        covered = (column // 2 + np.arange(6)) % steps
        frames[covered, 8:32, column] = 250
    frames = frames.clip(0, 255).astype(np.uint8)
    inside = np.s_[8:32]
    plain = np.median(frames, axis=0)[inside] - plate[inside]
    made = plate_without_masks(frames, 30, 0)[inside] - plate[inside]
    assert plain.mean() > 3
    assert abs(made.mean()) < 1


def test_masks_from_the_plate_are_the_person():
    plate, masks, frames = passing_square()
    frames[:, 40, 40] = 255 - plate[40, 40]
    assert np.array_equal(masks_from_plate(frames, plate, 20), masks)


def test_a_frame_without_the_person_gives_an_empty_mask():
    plate = room(32, 32)
    assert not masks_from_plate(plate[None], plate, 30).any()
