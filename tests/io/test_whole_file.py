from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.pictures import write_picture
from mocoflow_core.io.video import write_video
from mocoflow_core.io.whole_file import whole_file

GREY = np.full((32, 32, 3), 128, np.uint8)


def test_a_file_takes_its_name_once_it_is_written(tmp_path):
    with whole_file(tmp_path / "letter.txt") as beside:
        beside.write_text("dear")
        assert not (tmp_path / "letter.txt").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_after_a_failure_the_earlier_file_is_as_it_was(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(KeyError), whole_file(tmp_path / "letter.txt") as beside:
        beside.write_text("d")
        raise KeyError
    assert [path.read_text() for path in tmp_path.iterdir()] == ["dear"]


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("views.mp4", lambda path: write_video(path, [GREY] * 3, 12)),
        ("view.png", lambda path: write_picture(path, GREY)),
    ],
)
def test_a_full_disk_leaves_neither_half_a_video_nor_half_a_picture(tmp_path, name, write):
    (tmp_path / f".new.{name}").symlink_to("/dev/full")
    with pytest.raises(InputError, match="full disk"), full_disk_is_bad_input("It"):
        write(tmp_path / name)
    assert not list(tmp_path.iterdir())
