"""Whole videos as they come: each that is of no use ends in one line, each that is goes on."""

from __future__ import annotations

import json
import sys
import time

import cv2
import numpy as np
import pytest

from flows.command_line import main
from mocoflow_core.io.video import write_video
from mocoflow_core.io.video_facts import read_video_facts
from mocoflow_core.video import clip_frames
from tests.lossless_video import write_lossless
from tests.one_thread import one_thread  # noqa: F401
from tests.phone_video import write_at_times, write_turned
from tests.squat_pictures import empty_room, squat_pictures

# A quarter of the pictures' size: enough for one who fills them.
SIZE = (180, 320)
PERSON = [cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA) for picture in squat_pictures()]
ROOM = cv2.resize(empty_room(), SIZE, interpolation=cv2.INTER_AREA)
MOVING = [PERSON[row] for row in (0, 1, 2, 1, 0, 1, 2, 1, 0, 1)]
QUICK = ["--set", "bodies=none", "--set", "plate_frames=4", "--set", "working_fps=5"]


def moved(px: float) -> list[np.ndarray]:
    """The camera is carried sideways by so many pixels in all."""
    matrices = [np.array([[1, 0, share * px], [0, 1, 0]]) for share in np.linspace(0, 1, 10)]
    border = cv2.BORDER_REPLICATE
    return [
        cv2.warpAffine(picture, matrix, SIZE, borderMode=border)
        for picture, matrix in zip(MOVING, matrices, strict=True)
    ]


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """What a command says on stderr, and its exit code."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def command(*words) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["mocoflow", *map(str, words)])
        try:
            main()
            code = 0
        except SystemExit as ended:
            code = int(ended.code or 0)
        return code, capsys.readouterr().err

    return command


def require_one_line(code: int, said: str, words: str, out) -> None:
    assert code == 2
    lines = [line for line in said.splitlines() if words in line]
    assert len(lines) == 1, said
    assert "Traceback" not in said
    assert not out.exists()


@pytest.mark.parametrize(
    ("pictures", "words"),
    [
        ([ROOM] * 10, "a person who can be seen, got nobody in the video"),
        ([np.hstack((p, p[:, ::-1])) for p in MOVING], "2 of a size. Choose one: --person 0: "),
        (MOVING[:4] + [ROOM] * 9, "0.0 to 0.3 s of the video, in 4 of 13 frames"),
        (moved(30), "a camera that stands still (background motion below 1 %), got a moving one"),
        ([PERSON[0]] * 10, "a video of somebody who moves, got the same still picture"),
        (MOVING[:2], "a clip of at least 10 frames, got 2"),
    ],
    ids=["nobody", "two", "leaves", "carried", "photograph", "two frames"],
)
def test_a_video_of_no_use_is_refused_in_one_line(run, tmp_path, pictures, words):
    film, out = tmp_path / "film.mp4", tmp_path / "out"
    write_video(film, pictures, 10)
    require_one_line(*run("reconstruct", film, "--out", out), words, out)


def test_a_photograph_is_no_video(run, tmp_path):
    out = tmp_path / "out"
    for name in ("friend.jpg", "friend.png"):
        cv2.imwrite(str(tmp_path / name), PERSON[0][..., ::-1])
        words = f"a video, got the still picture {name}"
        require_one_line(*run("reconstruct", tmp_path / name, "--out", out), words, out)


def test_ten_minutes_are_refused_at_once_with_the_option_that_helps(run, tmp_path, monkeypatch):
    film, out = tmp_path / "long.mp4", tmp_path / "out"
    write_video(film, [np.full((48, 64, 3), row % 250, np.uint8) for row in range(6000)], 10)

    def decoded(*arguments):
        raise AssertionError("a frame was decoded")

    monkeypatch.setattr(clip_frames, "read_frames", decoded)
    begun = time.process_time()
    said = run("reconstruct", film, "--out", out)
    assert time.process_time() - begun < 5
    require_one_line(*said, "at most 60 s, got 600 s. Choose a part of the video: --clip", out)


def imported(run, film, out) -> tuple[dict, str]:
    code, said = run("import", "video", film, *QUICK, "--out", out)
    assert code == 0, said
    return json.loads((out / "scene.json").read_text()), said


def test_a_camera_that_trembles_is_a_word_of_caution_with_its_motion(run, tmp_path):
    write_lossless(tmp_path / "film.mp4", moved(1.5), 10)
    _, said = imported(run, tmp_path / "film.mp4", tmp_path / "out")
    (line,) = [line for line in said.splitlines() if "the camera should stand still" in line]
    measured = float(line.split("moves by ")[1].split(" px")[0])
    assert measured == pytest.approx(1.5, abs=0.5)


def test_an_upright_phone_gives_an_upright_scene(run, tmp_path):
    film = tmp_path / "film.mp4"
    write_turned(film, MOVING, 10, write_video)
    scene, _ = imported(run, film, tmp_path / "out")
    camera = scene["cameras"]["camera"]
    assert (camera["width"], camera["height"]) == SIZE
    mask = cv2.imread(str(sorted((tmp_path / "out/masks/camera").iterdir())[0]), 0) > 127
    rows, columns = np.nonzero(mask)
    assert np.ptp(rows) > 1.5 * np.ptp(columns)


def test_a_varying_rate_becomes_even_times_and_is_said(run, tmp_path):
    film = tmp_path / "film.mp4"
    times_ms = np.cumsum([0, *[100, 60, 100, 140] * 4, 300])
    pictures = [PERSON[row % 3] for row in range(len(times_ms))]
    write_at_times(film, pictures, times_ms)
    stored = read_video_facts(film).times_s
    assert stored == pytest.approx(times_ms / 1000, abs=2e-3)
    scene, said = imported(run, film, tmp_path / "out")
    assert "the video's rate varies (3.33 to 16.7 per second)" in said
    assert scene["fps"] == pytest.approx(10, rel=0.02)
    assert len(list((tmp_path / "out/frames/camera").iterdir())) == pytest.approx(19, abs=1)
