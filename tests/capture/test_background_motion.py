"""Laws of measuring whether the camera stands still."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.background_motion import background_motion_px
from tests.capsule_person import room

NOBODY = np.zeros((2, 120, 120), bool)


def moved(picture, shift):
    matrix = np.array([[1, 0, shift[0]], [0, 1, shift[1]]], float)
    return cv2.warpAffine(picture, matrix, (120, 120), borderMode=cv2.BORDER_REFLECT)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.2, -0.1), (0.4, 0.0), (0.5, 0.5)])
def test_a_slightly_moved_background_is_measured(shift):
    picture = room(120, 120)
    frames = np.stack([picture, moved(picture, shift)])
    # Phase correlation of interpolated pictures is good to about a tenth of a pixel.
    assert background_motion_px(frames, NOBODY) == pytest.approx(np.hypot(*shift), abs=0.12)


@pytest.mark.parametrize("shift", [(1.0, -2.0), (3.0, 1.5), (-6.0, 4.0)])
def test_a_moved_background_never_passes_for_a_still_one(shift):
    picture = room(120, 120)
    frames = np.stack([picture, moved(picture, shift)])
    assert background_motion_px(frames, NOBODY) > 1


def test_a_moving_person_is_no_moving_camera():
    picture = room(120, 120)
    frames = np.stack([picture, picture])
    masks = NOBODY.copy()
    masks[0, 20:70, 10:40] = masks[1, 20:70, 20:50] = True
    frames[masks] = 255
    assert background_motion_px(frames, masks) < 0.05


def test_what_moves_in_one_corner_is_no_moving_camera():
    picture = room(120, 120)
    other = picture.copy()
    other[:30, :30] = moved(picture, (6, 6))[:30, :30]
    assert background_motion_px(np.stack([picture, other]), NOBODY) < 0.05


def test_a_background_without_texture_shows_nothing():
    frames = np.full((2, 120, 120, 3), 255, np.uint8)
    assert np.isnan(background_motion_px(frames, NOBODY))
