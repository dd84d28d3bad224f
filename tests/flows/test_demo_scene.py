"""Synthetic scenes in the user's cache."""

from __future__ import annotations

import errno
import os

import pytest

from flows.demo_scene import demo_scene
from mocoflow_core.errors import InputError
from mocoflow_core.synthetic import scene_writer


def test_a_full_disk_is_bad_input_and_leaves_no_folder_behind(monkeypatch, tmp_path):
    def full(configuration, folder, progress):
        (folder / "frames").mkdir()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(scene_writer, "write_scene", full)
    with pytest.raises(InputError, match="full disk"):
        demo_scene("turn")
    assert not list((tmp_path / "mocoflow" / "scenes").iterdir())
