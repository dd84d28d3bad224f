from __future__ import annotations

import json

import pytest

from mocoflow_core.capture.names import is_one_line
from mocoflow_core.capture.scene_description import read_description
from mocoflow_core.errors import InputError
from mocoflow_core.synthetic.catalogue import named_scene


def described(name: str, camera: str) -> dict:
    flat = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    seen = {"width": 8, "height": 8, "K": flat, "R": flat, "t": [0.0] * 3, "frames": "frames"}
    return {
        "format": "mocoflow-scene",
        "version": 1,
        "name": name,
        "fps": 12.0,
        "world": {"unit": "m", "up": "+z"},
        "train_camera": camera,
        "cameras": {camera: seen},
    }


def read(folder, name: str, camera: str):
    (folder / "scene.json").write_text(json.dumps(described(name, camera)))
    return read_description(folder / "scene.json")


@pytest.mark.parametrize(
    "camera", ["../../elsewhere", "/etc/cron.d", "..", ".", "", "a/b", "a\\b", "a\nb", "a\x00b"]
)
def test_a_camera_that_would_write_elsewhere_is_refused(camera, tmp_path):
    with pytest.raises(InputError, match=r"folder is called|one line"):
        read(tmp_path, "someone", camera)


@pytest.mark.parametrize("name", ["two\nlines", "\x1b[2Jgone", "back\bspace", "line\u2028line"])
def test_a_scene_whose_name_would_move_the_cursor_is_refused(name, tmp_path):
    assert not is_one_line(name)
    with pytest.raises(InputError, match="one line"):
        read(tmp_path, name, "cam00")


@pytest.mark.parametrize("name", ["someone", "Anna 2 (left)", "<b>", "佐藤", "émile-x", ""])
def test_any_other_name_is_a_name(name, tmp_path):
    assert read(tmp_path, name, "cam00").name == name


def test_a_synthetic_scene_is_called_like_a_folder():
    for name in ("..", ".", "a/b"):
        with pytest.raises(InputError):
            named_scene(f"turn,name={name}")
    assert named_scene("turn,seed=1").name == "turn,seed=1"
