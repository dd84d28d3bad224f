"""annots.npy of ZJU-MoCap: names, gaps, and everything that only looks like it."""

from __future__ import annotations

from pathlib import PurePosixPath

import numpy as np
import pytest

from mocoflow_core.datasets.zju_annotations import (
    camera_name,
    frame_number,
    missing_parts,
    read_annotations,
)
from mocoflow_core.errors import InputError
from tests.datasets.studio import Z_DOWN, studio
from tests.datasets.zju_layout import (
    AS_RELEASED,
    NAMES_313,
    NAMES_377,
    ZjuLayout,
    annotations,
    picture_path,
    write_annotations,
)

LAYOUT_313 = ZjuLayout(nested_lists=True, time_stamped=True, first_number=1)


@pytest.fixture(scope="module")
def rigs():
    """Both camera rigs, with three frames; no picture is written."""
    return {
        names: studio(names, Z_DOWN, frames=3, width=16, height=16)
        for names in (NAMES_313, NAMES_377)
    }


def content(rig, layout=AS_RELEASED):
    numbers = rig.meshes.frame_indices + layout.first_number
    paths = {
        name: [picture_path(name, number, layout) for number in numbers.tolist()]
        for name in rig.cameras
    }
    return annotations(rig, paths, layout)


@pytest.fixture
def small(rigs):
    """Annotations that a test may spoil."""
    return content(rigs[NAMES_377])


def read(folder, given):
    write_annotations(folder, given)
    return read_annotations(folder)


def test_cameras_are_named_by_their_folders_whatever_their_place_in_the_list(tmp_path, rigs):
    found = read(tmp_path, content(rigs[NAMES_313], LAYOUT_313))
    assert list(found.calibrations)[18:] == ["Camera_19", "Camera_22", "Camera_23"]
    wanted = rigs[NAMES_313].cameras["Camera (22)"]
    np.testing.assert_allclose(found.calibrations["Camera_22"].R, wanted.R)
    np.testing.assert_allclose(found.calibrations["Camera_22"].t, wanted.t)


def test_frames_of_313_have_the_number_in_their_name_and_begin_with_1(tmp_path, rigs):
    found = read(tmp_path, content(rigs[NAMES_313], LAYOUT_313))
    assert list(found.pictures["Camera_1"]) == [1, 2, 3]


def test_all_23_cameras_of_the_other_subjects_are_read(tmp_path, rigs):
    found = read(tmp_path, content(rigs[NAMES_377]))
    assert list(found.calibrations) == list(NAMES_377)
    assert list(found.pictures["Camera_B23"]) == [0, 1, 2]


def test_21_cameras_of_a_thinned_out_rig_are_read_too(tmp_path, small):
    for key in small["cams"]:
        small["cams"][key] = small["cams"][key][:21]
    for item in small["ims"]:
        item["ims"] = item["ims"][:21]
    assert len(read(tmp_path, small).calibrations) == 21


def test_a_frame_that_a_camera_missed_shifts_no_calibration(tmp_path, small):
    del small["ims"][0]["ims"][1]
    found = read(tmp_path, small)
    assert list(found.pictures["Camera_B2"]) == [1, 2]
    assert list(found.pictures["Camera_B3"]) == [0, 1, 2]


def test_names_are_safe_and_numbers_are_the_fifth_token_or_the_stem():
    path = PurePosixPath("Camera (1)/CoreView_313_Camera_(1)_0012_2019-08-23_16-08-50.592.jpg")
    assert (camera_name(path), frame_number(path)) == ("Camera_1", 12)
    path = PurePosixPath("Camera_B1/000012.jpg")
    assert (camera_name(path), frame_number(path)) == ("Camera_B1", 12)
    with pytest.raises(InputError, match="original file names"):
        frame_number(PurePosixPath("Camera_B1/first.jpg"))


@pytest.mark.parametrize("path", ["../secret/000000.jpg", "/etc/000000.jpg", "C:\\x\\000000.jpg"])
def test_pictures_outside_the_folder_are_refused(tmp_path, small, path):
    small["ims"][0]["ims"][0] = path
    with pytest.raises(InputError, match="inside the subject's folder"):
        read(tmp_path, small)


def test_counts_that_disagree_are_refused(tmp_path, small):
    small["cams"]["R"] = small["cams"]["R"][:-1]
    with pytest.raises(InputError, match="23 K, 23 D, 22 R, 23 T"):
        read(tmp_path, small)


def test_a_matrix_of_another_size_is_refused(tmp_path, small):
    small["cams"]["K"][3] = np.eye(4)
    with pytest.raises(InputError, match="K of camera 3"):
        read(tmp_path, small)


def test_the_refined_release_is_refused_by_its_picture_paths(tmp_path, small):
    for item in small["ims"]:
        item["ims"] = [f"images/{row:02d}/000000.jpg" for row in range(23)]
    with pytest.raises(InputError, match="refined release"):
        read(tmp_path, small)


def test_annotations_without_pictures_are_refused(tmp_path, small):
    with pytest.raises(InputError, match=r"annots_new\.npy of the refined release"):
        read(tmp_path, small | {"ims": []})


def test_a_refined_folder_without_annots_is_refused(tmp_path, small):
    write_annotations(tmp_path, small | {"ims": []}, "annots_new.npy")
    with pytest.raises(InputError, match="refined release"):
        read_annotations(tmp_path)
    assert any("refined release" in part for part in missing_parts(tmp_path))


def test_genebody_cameras_are_refused(tmp_path):
    camera = {"c2w": np.eye(4), "K": np.eye(3), "D": np.zeros(5)}
    with pytest.raises(InputError, match="GeneBody"):
        read(tmp_path, {"cams": {"00": camera, "01": camera}, "ims": []})


def test_cameras_that_lack_a_part_are_refused(tmp_path, small):
    del small["cams"]["D"]
    with pytest.raises(InputError, match="no D"):
        read(tmp_path, small)


@pytest.mark.parametrize(
    ("file", "named"), [("mesh_infos.pkl", "HumanNeRF"), ("intri.yml", "EasyMocap")]
)
def test_derived_files_are_refused_by_name(tmp_path, file, named):
    (tmp_path / file).write_bytes(b"")
    with pytest.raises(InputError, match=named):
        read_annotations(tmp_path)


def test_a_folder_with_nothing_of_it_says_what_is_expected(tmp_path):
    with pytest.raises(InputError, match=r"annots\.npy"):
        read_annotations(tmp_path)


def test_a_name_that_is_no_data_in_the_pickle_is_refused_without_running(tmp_path):
    class Hostile:
        def __reduce__(self):
            return (open, (str(tmp_path / "ran"), "w"))

    with pytest.raises(InputError):
        read(tmp_path, {"cams": Hostile(), "ims": []})
    assert not (tmp_path / "ran").exists()
