"""Files that a data set names lie in its folder, or are refused."""

from __future__ import annotations

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import file_inside


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "CoreView_377"
    (folder / "Camera_B1").mkdir(parents=True)
    (folder / "Camera_B1" / "000000.jpg").write_bytes(b"picture")
    (tmp_path / "secret").write_text("secret")
    return folder


def test_files_within_are_found(folder):
    assert file_inside(folder, "Camera_B1/000000.jpg").read_bytes() == b"picture"
    assert file_inside(folder, "./Camera_B1/000000.jpg").is_file()


@pytest.mark.parametrize(
    "name", ["../secret", "Camera_B1/../../secret", "..\\secret", "/etc/hostname", "C:\\a", "a\0b"]
)
def test_names_that_lead_outside_are_refused(folder, name):
    with pytest.raises(InputError, match="named relative to it"):
        file_inside(folder, name)


def test_links_that_lead_outside_are_refused_and_those_within_followed(folder):
    (folder / "out.jpg").symlink_to(folder.parent / "secret")
    (folder / "up").symlink_to(folder.parent)
    (folder / "in.jpg").symlink_to(folder / "Camera_B1" / "000000.jpg")

    for name in ("out.jpg", "up/secret"):
        with pytest.raises(InputError, match="must lie in its folder"):
            file_inside(folder, name)
    assert file_inside(folder, "in.jpg").read_bytes() == b"picture"


def test_the_folder_itself_may_be_reached_through_a_link(folder):
    link = folder.parent / "data"
    link.symlink_to(folder)
    assert file_inside(link, "Camera_B1/000000.jpg").read_bytes() == b"picture"


def test_what_is_missing_or_no_file_is_said(folder):
    for name in ("Camera_B2/000000.jpg", "Camera_B1"):
        with pytest.raises(InputError, match=f"{name} must be a file"):
            file_inside(folder, name)
