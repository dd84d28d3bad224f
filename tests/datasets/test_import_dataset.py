"""Importing: read, checked and written as one; nothing is left where it fails."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocoflow_core.capture.scene import open_scene
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.import_dataset import configure, import_dataset
from mocoflow_core.datasets.kinds import KINDS, DatasetKind
from mocoflow_core.errors import InputError
from tests.datasets.aist_layout import SEQUENCE, write_aist
from tests.datasets.in_memory import MemoryFrames, walking_dataset, with_camera
from tests.datasets.studio import Y_UP, Z_DOWN, studio
from tests.datasets.zju_layout import write_zju

SCENE = replace(walking_dataset(), remarks=("capsules are assumed",))


class Choices(ConfigurationPart):
    """Without a body model."""

    stride: int = 2


def kind(scene) -> DatasetKind:
    return DatasetKind("capsules", Choices, lambda source, choices: scene, lambda folder: [])


def test_what_was_assumed_and_measured_is_kept_beside_the_scene(tmp_path):
    imported = import_dataset(kind(SCENE), tmp_path, Choices(stride=3), tmp_path / "scene")
    assert open_scene(tmp_path / "scene").description.name == "walking"
    record = json.loads((tmp_path / "scene" / "import.json").read_text())
    assert record["kind"] == "capsules"
    assert record["configuration"] == {"stride": 3}
    assert record["remarks"] == ["capsules are assumed"]
    assert record["measured"] == imported.measured
    assert record["warnings_of_evaluation_cameras"] == list(imported.elsewhere)
    assert "overlap at +0 of side" in imported.measured
    assert "overlap at +0 of side" not in imported.of_train_camera
    assert {"height_m", "overlap at +0 of front"} <= set(imported.of_train_camera)


def test_what_fails_a_check_is_not_written(tmp_path):
    empty = {number: np.zeros((96, 64), bool) for number in range(20, 29)}
    wrong = with_camera(SCENE, "front", masks=MemoryFrames(empty))
    with pytest.raises(InputError, match="show the person"):
        import_dataset(kind(wrong), tmp_path, Choices(), tmp_path / "scene")
    assert not list(tmp_path.iterdir())


def test_a_folder_with_content_is_refused_before_anything_is_read(tmp_path):
    def read(source, choices):
        raise AssertionError("read")

    (tmp_path / "note").touch()
    with pytest.raises(InputError, match="new or empty"):
        import_dataset(replace(kind(SCENE), read=read), tmp_path, Choices(), tmp_path)


def test_choices_are_set_by_name_and_a_body_model_where_one_is_taken():
    known = KINDS["people-snapshot"]
    chosen = configure(known, ("stride=1", "gender=male"), Path("models"))
    assert (chosen.stride, chosen.gender, chosen.body_model) == (1, "male", Path("models"))
    with pytest.raises(InputError, match="no body model for capsules"):
        configure(kind(SCENE), (), Path("models"))


def zju(folder, **content):
    write_zju(folder, studio(("Camera_B1", "Camera_B2"), Z_DOWN, frames=2, width=32, height=48))
    (folder / "annots.npy").unlink()
    (folder / "annots.json").write_text(json.dumps(content))


def nested(folder):
    zju(folder)
    (folder / "annots.json").write_text("[" * 10**5)


def aist(folder, file, write):
    filmed = studio(("c01", "c09"), Y_UP, frames=2, width=32, height=48)
    write(
        write_aist(folder, filmed, {"smpl_poses": {}}, {"keypoints3d": {}}) / "annotations" / file
    )


CAMS = {"K": 5, "D": 5, "R": 5, "T": 5}
OTHER_CONTENT = {
    "numbers for lists of cameras": lambda folder: zju(folder, cams=CAMS, ims=[]),
    "a number for pictures": lambda folder: zju(folder, cams={k: [] for k in CAMS}, ims=7),
    "deep nesting": nested,
    "no text": lambda folder: aist(
        folder, "cameras/mapping.txt", lambda file: file.write_bytes(b"s\xe9quence x")
    ),
    "no size": lambda folder: aist(
        folder,
        "cameras/setting10_2.json",
        lambda file: file.write_text(file.read_text().replace("[32, 48]", "[null, 1]")),
    ),
    "no poses": lambda folder: aist(folder, "ignore_list.txt", lambda file: None),
    "no keypoints": lambda folder: aist(
        folder, f"motions/{SEQUENCE}.pkl", lambda file: file.unlink()
    ),
}


@pytest.mark.parametrize("what", OTHER_CONTENT)
def test_other_content_than_a_data_sets_is_refused_in_one_line(what, tmp_path):
    OTHER_CONTENT[what](tmp_path / "data")
    known = KINDS["zju-mocap" if list((tmp_path / "data").glob("annots*.json")) else "aist"]
    chosen = configure(known, ("bodies=none",), None)
    with pytest.raises(InputError) as refused:
        import_dataset(known, tmp_path / "data", chosen, tmp_path / "scene")
    assert "\n" not in str(refused.value)
