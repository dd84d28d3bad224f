"""Laws of the camera that must stand still, and of the person that must not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.video.camera_check import require_movement, require_still_camera

SIZE = 320


def room(shift=0):
    """A textured wall (320, 320, 3), moved to the right by pixels."""
    noise = np.random.default_rng(0).uniform(0, 255, (SIZE, SIZE, 3))
    wall = cv2.GaussianBlur(noise, (0, 0), 3)
    wall = (wall - wall.mean()) * 6 + 128
    return np.roll(wall, shift, axis=1).clip(0, 255).astype(np.uint8)


def with_person(picture, row):
    mask = np.zeros((SIZE, SIZE), bool)
    mask[100:260, 120 + 4 * row : 180 + 4 * row] = True
    return np.where(mask[..., None], np.uint8([200, 30, 40]), picture), mask


def clip(shifts):
    pairs = [with_person(room(shift), row) for row, shift in enumerate(shifts)]
    frames, masks = zip(*pairs, strict=True)
    return np.stack(frames), np.stack(masks)


def test_a_person_who_moves_is_no_moving_camera():
    moved, said = require_still_camera(*clip([0, 0, 0, 0]))
    assert moved < 0.1
    assert not said.startswith("caution")


def test_a_trembling_camera_is_a_word_of_caution_with_the_measured_motion():
    moved, said = require_still_camera(*clip([0, 1, 2, 1]))
    assert moved == pytest.approx(2, abs=0.5)
    assert said.startswith(f"caution: the background moves by {moved:.1f} px")


def test_a_carried_camera_is_refused():
    with pytest.raises(InputError, match=r"stands still .* got a moving one: .* by 1[12]\.\d px"):
        require_still_camera(*clip([0, 4, 8, 12]))


def test_a_plain_wall_shows_nothing():
    frames, masks = clip([0, 0])
    _, said = require_still_camera(np.where(masks[..., None], frames, np.uint8(90)), masks)
    assert "too plain" in said


def test_a_picture_shown_again_and_again_is_refused():
    picture, mask = with_person(room(), 0)
    noise = np.random.default_rng(1).integers(0, 2, (5, SIZE, SIZE, 3)).astype(np.uint8)
    frames = picture // 2 + noise
    with pytest.raises(InputError, match="the same still picture"):
        require_movement(frames, np.stack([mask] * 5))
    require_movement(*clip([0, 0, 0, 0]))
