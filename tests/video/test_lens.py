"""Laws of the focal length of a video."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.video.lens import camera_of_video

FULL, SMALL = (1080, 1920), (720, 1280)


def test_a_given_focal_length_is_of_the_videos_pixels_and_shrinks_with_them():
    camera, said = camera_of_video("camera", FULL, SMALL, 1500.0, {})
    assert camera.K.tolist() == [[1000, 0, 360], [0, 1000, 640], [0, 0, 1]]
    assert (camera.width, camera.height) == SMALL
    assert np.array_equal(camera.R, np.eye(3))
    assert not camera.t.any()
    assert "1500 px, as given" in said


def test_a_phone_that_writes_it_down_is_believed():
    key = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
    camera, said = camera_of_video("camera", (1920, 1080), (1920, 1080), None, {key: "26"})
    diagonal = np.hypot(1920, 1080)
    assert camera.K[0, 0] == pytest.approx(diagonal * 26 / 43.27)
    assert key in said


@pytest.mark.parametrize("metadata", [{}, {"make": "phone"}, {"focal 35mm": "unknown"}])
def test_a_guess_is_called_one_with_its_error(metadata):
    camera, said = camera_of_video("camera", FULL, FULL, None, metadata)
    assert 0.6 < camera.K[0, 0] / np.hypot(*FULL) < 0.85
    assert "guessed" in said
    assert "20 %" in said
    assert "--focal" in said


def test_a_focal_length_in_millimetres_is_refused():
    with pytest.raises(InputError, match="focal length in pixels of the video's 1080 x 1920"):
        camera_of_video("camera", FULL, FULL, 26.0, {})
