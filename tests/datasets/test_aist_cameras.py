"""Settings and cameras of AIST++: opaque names, lookup by camera name, centimetres."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.undistort import distort
from mocoflow_core.datasets.aist_cameras import for_pictures, read_cameras, read_mapping
from mocoflow_core.datasets.aist_names import parse_name, require_annotated
from mocoflow_core.errors import InputError
from tests.datasets.aist_layout import write_cameras
from tests.datasets.studio import Y_UP, bent, studio

DATA = Path(__file__).parents[1] / "data/aist"
SEQUENCE = "gWA_sFM_cAll_d27_mWA5_ch20"
DISTORTION = [-0.06, 0.02, 0.001, -0.002, 0.004]


@pytest.fixture(scope="module")
def filmed():
    return bent(studio(("c01", "c02", "c09"), Y_UP, width=64, height=36, frames=1), DISTORTION)


@pytest.fixture
def folder(tmp_path, filmed):
    (tmp_path / "mapping.txt").write_text(f"{SEQUENCE} setting10_2\n")
    write_cameras(tmp_path / "setting10_2.json", filmed)
    return tmp_path


def test_the_real_mapping_names_settings_with_underscores():
    mapping = read_mapping(DATA / "mapping.txt")
    assert len(mapping) == 19
    assert mapping[SEQUENCE] == "setting10_2"
    assert Counter("_" in setting for setting in set(mapping.values())) == {True: 8, False: 6}
    for name in mapping:
        require_annotated(parse_name(name))


def test_lines_of_a_mapping_have_two_words_however_far_apart(tmp_path):
    (tmp_path / "mapping.txt").write_text(f"\n{SEQUENCE} \t setting1 \r\n\n")
    assert read_mapping(tmp_path / "mapping.txt") == {SEQUENCE: "setting1"}
    (tmp_path / "mapping.txt").write_text(f"{SEQUENCE}\n")
    with pytest.raises(InputError, match="line 1"):
        read_mapping(tmp_path / "mapping.txt")


def test_cameras_come_back_in_metres_with_the_corner_origin(folder, filmed):
    cameras = read_cameras(folder, SEQUENCE, 0.01)
    assert set(cameras) == set(filmed.cameras)
    for name, camera in filmed.cameras.items():
        for part in ("K", "R", "t", "distortion"):
            np.testing.assert_allclose(
                getattr(cameras[name], part), getattr(camera, part), atol=1e-9
            )


def test_projection_is_opencvs(folder):
    """Its pixel centres are integers, ours lie at +0.5."""
    camera = read_cameras(folder, SEQUENCE, 0.01)["c02"]
    listed = json.loads((folder / "setting10_2.json").read_text())[1]
    points_cm = np.array([[0.0, 100, 0], [30, 60, -20], [-25, 140, 10]])
    theirs, _ = cv2.projectPoints(
        points_cm,
        *(np.array(listed[key]) for key in ("rotation", "translation", "matrix", "distortions")),
    )
    ours = distort(camera.project(points_cm / 100), camera)
    np.testing.assert_allclose(ours - 0.5, theirs[:, 0], atol=1e-6)


def test_cameras_are_looked_up_by_name_not_by_place(folder, filmed):
    write_cameras(folder / "setting10_2.json", filmed, backwards=True)
    cameras = read_cameras(folder, SEQUENCE, 0.01)
    np.testing.assert_allclose(cameras["c09"].R, filmed.cameras["c09"].R, atol=1e-9)


def test_another_unit_moves_cameras_only(folder):
    centimetres, other = (read_cameras(folder, SEQUENCE, unit)["c01"] for unit in (0.01, 1 / 98))
    np.testing.assert_allclose(other.t, centimetres.t * 100 / 98)
    np.testing.assert_array_equal(other.K, centimetres.K)


def test_a_sequence_or_setting_that_is_not_there_is_told(folder):
    with pytest.raises(InputError, match=r"mapping\.txt"):
        read_cameras(folder, "gBR_sBM_cAll_d04_mBR0_ch01", 0.01)
    (folder / "setting10_2.json").unlink()
    with pytest.raises(InputError, match=r"setting10_2\.json"):
        read_cameras(folder, SEQUENCE, 0.01)


@pytest.mark.parametrize(
    "change",
    [
        {"matrix": [1, 2]},
        {"name": "../c01"},
        {"rotation": [0, 0, float("nan")]},
        {"translation": None},
        {"size": "large"},
    ],
)
def test_incomplete_cameras_are_refused(folder, change):
    file = folder / "setting10_2.json"
    cameras = json.loads(file.read_text())
    file.write_text(json.dumps([cameras[0] | change, *cameras[1:]]))
    with pytest.raises(InputError, match=r"setting10_2\.json"):
        read_cameras(folder, SEQUENCE, 0.01)


def test_smaller_videos_scale_the_intrinsics(filmed):
    camera = filmed.cameras["c01"]
    smaller = for_pictures(camera, 32, 18)
    points = np.array([[0.1, 0.9, 0.2]])
    np.testing.assert_allclose(2 * smaller.project(points), camera.project(points))
    assert for_pictures(camera, 64, 36) is camera


def test_videos_of_another_shape_are_refused(filmed):
    wide = replace(filmed.cameras["c01"], width=1920, height=1080)
    with pytest.raises(InputError, match="640 x 480"):
        for_pictures(wide, 640, 480)


def test_a_setting_that_leads_elsewhere_is_refused(folder):
    (folder / "mapping.txt").write_text(f"{SEQUENCE} ../elsewhere\n")
    with pytest.raises(InputError, match=r"mapping\.txt"):
        read_cameras(folder, SEQUENCE, 0.01)
