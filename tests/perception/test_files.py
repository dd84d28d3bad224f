from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.perception.files import AlphaPoseFile


def entry(image: str, x: float, confidence: float = 0.9, points: int = 17, **more) -> dict:
    keypoints = [value for point in range(points) for value in (x + point, 2.0 * point, confidence)]
    return {"image_id": image, "category_id": 1, "keypoints": keypoints, "score": 3.0, **more}


def write(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content))
    return path


@pytest.fixture
def file(tmp_path: Path) -> AlphaPoseFile:
    entries = [
        entry("out0000003.png", 100.0, 0.5, box=[95.0, 0.0, 30.0, 40.0]),
        entry("out0000003.png", 10.0, 1.107, points=26, idx=[0.0]),
        entry("out0000007.png", 10.0, 0.8),
    ]
    return AlphaPoseFile(write(tmp_path / "alphapose-results.json", entries))


def test_pictures_are_found_by_their_numbers_and_one_without_a_person_is_empty(file):
    assert file.frames == [3, 7]
    blank = np.zeros((4, 4, 3), np.uint8)
    found = file.at([3, 4]).boxes([blank, blank])
    assert [len(boxes.confidence) for boxes in found] == [2, 0]
    assert file.at([4]).keypoints([blank], [np.array([0.0, 0.0, 9.0, 9.0])]) == [None]


def test_the_person_in_the_box_is_the_one(file):
    blank = np.zeros((4, 4, 3), np.uint8)
    (pose,) = file.at([3]).keypoints([blank], [np.array([98.0, 0.0, 120.0, 35.0])])
    assert pose.places[0].tolist() == [100.5, 0.5]
    (other,) = file.at([3]).keypoints([blank], [np.array([10.0, 0.0, 30.0, 35.0])])
    assert other.places.shape == (17, 2)
    assert other.confidence.max() == 1.0


@pytest.mark.parametrize(
    "content",
    [
        {"a": 1},
        [entry("nameless.png", 0.0)],
        [entry("1.png", 0.0, points=18)],
        [entry("1.png", float("nan"))],
        [{"image_id": "1.png"}],
        [entry("1.png", 10**400)],
        [entry("1.png", 0.0, box=[0.0, 0.0, float("inf"), 1.0])],
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path, content):
    with pytest.raises(InputError, match="AlphaPose") as refused:
        AlphaPoseFile(write(tmp_path / "file.json", content))
    assert "\n" not in str(refused.value)


def test_a_text_that_is_nested_without_end_is_refused_in_one_line(tmp_path):
    (tmp_path / "file.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match="as JSON"):
        AlphaPoseFile(tmp_path / "file.json")
