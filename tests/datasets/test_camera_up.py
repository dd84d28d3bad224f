"""Up is taken from the cameras, never assumed."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.datasets.camera_up import up_of_cameras
from mocoflow_core.errors import InputError
from tests.datasets.studio import Y_UP, Z_DOWN, studio

NAMES = ("a", "b", "c")


def rotations(world):
    cameras = studio(NAMES, world, width=16, height=16, frames=1).cameras.values()
    return [camera.R for camera in cameras]


@pytest.mark.parametrize(
    ("world", "up"), [(np.eye(3), "+z"), (Z_DOWN, "-z"), (Y_UP, "+y"), (-Y_UP, "-y")]
)
def test_up_follows_the_world(world, up):
    assert up_of_cameras(rotations(world), up)[0] == up


def test_another_up_than_the_known_files_have_is_told():
    _, remark = up_of_cameras(rotations(np.eye(3)), "-z")
    assert "in the known files of this data set it is -z" in remark


def test_cameras_that_lie_askew_need_a_word_from_the_user():
    turn = np.linalg.qr(np.array([[1.0, 0, 1], [0, 1, 1], [-1, -1, 1]]))[0]
    with pytest.raises(InputError, match="field up"):
        up_of_cameras(rotations(turn), "-z")
