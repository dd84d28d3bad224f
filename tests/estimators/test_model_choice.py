"""A folder of body models gives each tool the one of its family and gender."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.model_choice import choose_model
from tests.estimators import layouts
from tests.estimators.layouts import Person

NAMES = (
    "smpl/SMPL_NEUTRAL.pkl",
    "smpl/basicmodel_m_lbs_10_207_0_v1.0.0.pkl",
    "smpl/SMPL_FEMALE.pkl",
    "smplx/SMPLX_NEUTRAL.npz",
)


@pytest.fixture
def folder(tmp_path):
    for name in NAMES:
        (tmp_path / "models" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "models" / name).touch()
    return tmp_path / "models"


@pytest.fixture
def estimates(tmp_path, person, smplx):
    """An estimate by the name of the model that it needs."""
    np.savez(tmp_path / "meshes.npz", vertices=1, faces=1, frame_indices=1)
    people = {1: layouts.vibe_record(person)}
    return {
        "SMPL_NEUTRAL.pkl": layouts.write_people(tmp_path / "vibe.pkl", people),
        "basicmodel_m_lbs_10_207_0_v1.0.0.pkl": layouts.write_people(
            tmp_path / "aist.pkl", layouts.aist_motion(person)
        ),
        "SMPLX_NEUTRAL.npz": layouts.write_gvhmr(tmp_path / "gvhmr.pt", Person.of(smplx)),
        None: tmp_path / "meshes.npz",
    }


def test_each_tool_gets_its_own_from_the_given_or_the_users_folder(folder, estimates, tmp_path):
    given = EstimateConfig(body_model=folder)
    for name, estimate in estimates.items():
        for chosen, by_default in ((given, tmp_path / "none"), (EstimateConfig(), folder)):
            found = choose_model(estimate, chosen, by_default)
            assert (found and found.name) == name


def test_a_file_is_taken_as_it_is(folder, estimates):
    file = folder / "smpl/SMPL_FEMALE.pkl"
    chosen = EstimateConfig(body_model=file)
    assert all(choose_model(path, chosen, folder) == file for path in estimates.values())
    assert choose_model(None, chosen, folder) == file


def test_a_given_folder_must_have_the_model_the_users_need_not(folder, estimates, tmp_path):
    chosen = EstimateConfig(body_model=folder / "smpl")
    with pytest.raises(InputError, match=r"SMPL-X model file.*folder without.*smpl-x\.is\.tue"):
        choose_model(estimates["SMPLX_NEUTRAL.npz"], chosen, folder)
    assert choose_model(estimates["SMPLX_NEUTRAL.npz"], EstimateConfig(), folder / "smpl") is None
    assert choose_model(estimates["SMPL_NEUTRAL.pkl"], EstimateConfig(), tmp_path / "none") is None
