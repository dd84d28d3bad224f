"""Up is taken from the cameras, never assumed."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.datasets.camera_up import up_of_cameras
from mocoflow_core.errors import InputError
from tests.datasets.studio import Y_UP, Z_DOWN, studio

NAMES = ("a", "b", "c")


@pytest.mark.parametrize(
    ("world", "up"), [(np.eye(3), "+z"), (Z_DOWN, "-z"), (Y_UP, "+y"), (-Y_UP, "-y")]
)
def test_up_follows_the_world(world, up):
    cameras = studio(NAMES, world, width=16, height=16, frames=1).cameras.values()
    assert up_of_cameras(cameras, up)[0] == up


def test_another_up_than_the_known_files_have_is_told():
    cameras = studio(NAMES, np.eye(3), width=16, height=16, frames=1).cameras.values()
    _, remark = up_of_cameras(cameras, "-z")
    assert "in the known files of this data set it is -z" in remark


def test_cameras_that_lie_askew_need_a_word_from_the_user():
    turn = np.linalg.qr(np.array([[1.0, 0, 1], [0, 1, 1], [-1, -1, 1]]))[0]
    cameras = studio(NAMES, turn, width=16, height=16, frames=1).cameras.values()
    with pytest.raises(InputError, match="field up"):
        up_of_cameras(cameras, "-z")
