"""Motions of AIST++: shapes of all sorts, centimetres, a scale that takes the pelvis along."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.aist_motion import motion_vertices, read_motion
from tests.estimators.layouts import aist_motion

REAL = Path(__file__).parents[1] / "data/aist/gWA_sFM_cAll_d27_mWA5_ch20.pkl"


@pytest.fixture
def write(tmp_path):
    def writing(motion):
        path = tmp_path / "gBR_sBM_cAll_d04_mBR0_ch01.pkl"
        path.write_bytes(pickle.dumps(motion, protocol=4))
        return path

    return writing


def test_bodies_are_scaled_about_the_models_origin_and_brought_to_metres(
    write, person, smpl, read, smpl_file
):
    person.betas[:] = 0
    estimate = read(write(aist_motion(person, scaling=98.0)), body_model=smpl_file)
    assert (estimate.coordinates, estimate.located) == ("world", True)
    assert estimate.frame_indices.tolist() == [0, 1, 2, 3]
    expected = 0.98 * person.bodies + person.translations[:, None]
    assert np.allclose(estimate.vertices, expected, atol=1e-5)


@pytest.mark.parametrize("scaling", [98.0, np.float32([98.0]), np.float32([[98.0]])])
def test_the_scaling_is_a_number_in_any_wrapping(write, person, scaling):
    motion = {**aist_motion(person), "smpl_scaling": scaling}
    assert read_motion(write(motion)).scaling == 98.0


@pytest.mark.parametrize("shape", [(-1, 72), (-1, 24, 3)])
def test_poses_may_be_flat_or_not(write, person, shape):
    motion = aist_motion(person)
    motion["smpl_poses"] = motion["smpl_poses"].reshape(shape)
    assert np.array_equal(read_motion(write(motion)).poses, person.pose)


def test_some_rows_of_a_motion_are_enough(write, person, smpl):
    motion = read_motion(write(aist_motion(person)))
    some = motion_vertices(motion, smpl, np.array([1, 3]))
    assert np.allclose(some, motion_vertices(motion, smpl)[[1, 3]], atol=1e-6)


def test_arrays_that_do_not_belong_together_are_refused(write, person):
    motion = {**aist_motion(person), "smpl_trans": np.zeros((3, 3))}
    with pytest.raises(InputError, match=r"poses \(N, 72\)"):
        read_motion(write(motion))


def test_something_else_is_no_motion(write):
    with pytest.raises(InputError, match="smpl_poses"):
        read_motion(write({"keypoints3d": np.zeros((2, 17, 3))}))


def test_the_model_is_asked_for(write, person, read):
    with pytest.raises(InputError, match=r"AIST\+\+ motion.*--body-model"):
        read(write(aist_motion(person)))


def test_a_real_motion_is_read(smpl, read, smpl_file):
    motion = read_motion(REAL)
    assert motion.poses.shape == (8, 24, 3)
    assert motion.scaling == pytest.approx(98.02434)
    bodies = motion_vertices(motion, smpl)
    assert 1.0 < np.ptp(bodies, axis=1).max() < 2.5
    assert 0.5 < bodies[..., 1].mean() < 2.0
    assert len(read(REAL, body_model=smpl_file).frame_indices) == 8
