"""Laws of what is said of a bare video on the command line."""

from __future__ import annotations

import sys

import pytest

from flows.command_line import main
from flows.request import Request
from flows.video_options import is_bare_video, video_settings
from mocoflow_core.errors import InputError


def test_options_are_fields_of_the_videos_configuration():
    said = video_settings(1500.0, "5-20.5", 1, "video.")
    chosen = Request(scene_path="film.mp4", settings=tuple(said)).configuration.video
    assert (chosen.focal_px, chosen.start_s, chosen.end_s, chosen.person) == (1500, 5, 20.5, 1)
    assert video_settings(None, None, None) == []


@pytest.mark.parametrize("clip", ["5", "20-5", "a-b", "1-2-3"])
def test_a_clip_is_two_growing_seconds(clip):
    with pytest.raises(InputError, match="--clip START-END"):
        video_settings(None, clip, None)


def test_a_scene_is_no_bare_video(tmp_path):
    for name in ("film.mp4", "scene.json"):
        (tmp_path / name).touch()
    assert is_bare_video(tmp_path / "film.mp4")
    assert not is_bare_video(tmp_path / "scene.json")
    assert not is_bare_video(tmp_path)


def test_what_is_said_of_a_video_is_refused_of_a_scene(toy_scene):
    request = Request(scene_path=toy_scene, settings=("video.focal_px=900",))
    with pytest.raises(InputError, match="a bare video, of which something is said"):
        _ = request.scene


@pytest.mark.parametrize("command", [["import", "video"], ["reconstruct"], ["plan"]])
def test_a_file_that_is_no_video_is_one_line(monkeypatch, capsys, tmp_path, command):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    film = tmp_path / "film.mp4"
    film.write_text("no film")
    out = [] if command == ["plan"] else ["--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", ["mocoflow", *command, str(film), *out])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "film.mp4 must be a video that can be decoded" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
