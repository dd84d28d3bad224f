"""Small body models as files and in memory, and the reading of an estimate with them."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.read import read_estimate
from tests.estimators.layouts import CAMERA, Person
from tests.small_smpl import write_smpl, write_smplx

VERTICES = 500


@pytest.fixture(scope="session")
def smpl_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "SMPL_NEUTRAL.pkl"
    write_smpl(path, VERTICES)
    return path


@pytest.fixture(scope="session")
def smplx_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "SMPLX_NEUTRAL.npz"
    write_smplx(path, VERTICES)
    return path


@pytest.fixture(scope="session")
def smpl(smpl_file):
    return read_smpl_model(smpl_file)


@pytest.fixture(scope="session")
def smplx(smplx_file):
    return read_smpl_model(smplx_file)


@pytest.fixture
def person(smpl):
    return Person.of(smpl)


@pytest.fixture
def read():
    """Reads an estimate as made from pictures of ``CAMERA``."""

    def reading(path, **chosen):
        return read_estimate(path, EstimateContext(CAMERA, EstimateConfig(**chosen)))

    return reading


@pytest.fixture
def faces_file(tmp_path, smpl):
    """A mesh with the model's faces."""
    path = tmp_path / "faces.npz"
    np.savez(path, vertices=smpl.template[None], faces=smpl.faces, frame_indices=[0])
    return path
