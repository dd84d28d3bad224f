"""The body model of a subject: its gender, and the user's file for it."""

from __future__ import annotations

import pytest

from mocoflow_core.datasets.body_model_file import find_body_model
from mocoflow_core.datasets.snapshot_bodies import gender_of
from mocoflow_core.errors import InputError


@pytest.mark.parametrize(
    ("folder", "gender"),
    [
        ("female-3-casual", "female"),
        ("male-3-casual", "male"),
        ("FEMALE-1-sport", "female"),
        ("somebody", None),
    ],
)
def test_female_is_not_taken_for_male(folder, gender):
    assert gender_of(folder, "by name") == gender
    assert gender_of(folder, "male") == "male"


@pytest.mark.parametrize(
    ("gender", "name"),
    [
        ("female", "SMPL_FEMALE.pkl"),
        ("male", "SMPL_MALE.npz"),
        ("neutral", "SMPL_NEUTRAL.pkl"),
        ("female", "basicModel_f_lbs_10_207_0_v1.0.0.pkl"),
        ("male", "basicmodel_m_lbs_10_207_0_v1.0.0.pkl"),
        ("neutral", "basicModel_neutral_lbs_10_207_0_v1.0.0.pkl"),
    ],
)
def test_the_usual_names_are_found_in_a_folder(tmp_path, gender, name):
    for other in ("SMPL_FEMALE.txt", "SMPLX_FEMALE.npz", "notes.pkl"):
        (tmp_path / other).touch()
    (tmp_path / "smpl" / "models").mkdir(parents=True)
    (tmp_path / "smpl" / "models" / name).touch()
    assert find_body_model(tmp_path, gender, "pose")[0].name == name


def test_of_several_versions_the_first_is_taken_and_told(tmp_path):
    for version in ("v1.1.0", "v1.0.0"):
        (tmp_path / f"basicmodel_f_lbs_10_207_0_{version}.pkl").touch()
    file, remark = find_body_model(tmp_path, "female", "pose")
    assert "v1.0.0" in file.name
    assert "v1.1.0" in remark


def test_a_file_is_taken_as_it_is_and_another_gender_told(tmp_path):
    file = tmp_path / "SMPL_MALE.pkl"
    file.touch()
    assert find_body_model(file, "male", "pose") == (file, None)
    assert "is male by its name" in find_body_model(file, "female", "pose")[1]


@pytest.mark.parametrize("given", [None, "nowhere", "."])
def test_without_the_file_the_error_says_which_and_where_to_get_it(tmp_path, given):
    with pytest.raises(InputError) as refused:
        find_body_model(given and tmp_path / given, "female", "pose this subject")
    assert "female SMPL model to pose this subject" in str(refused.value)
    assert "smpl.is.tue.mpg.de" in str(refused.value)
