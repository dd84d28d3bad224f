"""Keypoints of AIST++ are truth in metres; what is unknown stays unknown."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from mocoflow_core.datasets.aist_keypoints import keypoint_truth
from mocoflow_core.errors import InputError

CLIP = np.arange(2, 6, dtype=np.int32)


@pytest.fixture
def points_cm():
    points = np.random.default_rng(0).normal(100, 40, (10, 17, 3))
    points[3, 5] = np.nan
    return points


def write(file, content):
    file.write_bytes(pickle.dumps(content, protocol=4))
    return file


def test_the_smoothed_ones_are_preferred_and_become_metres(tmp_path, points_cm):
    content = {"keypoints3d": points_cm + 7, "keypoints3d_optim": points_cm}
    truth, remarks = keypoint_truth(write(tmp_path / "k.pkl", content), CLIP, 0.01)
    np.testing.assert_allclose(truth.keypoints3d, points_cm[2:6] / 100, rtol=1e-6)
    assert truth.frame_indices.tolist() == [2, 3, 4, 5]
    assert "keypoints3d_optim" in remarks[0]
    assert truth.vertices is None


def test_unknown_points_stay_unknown(tmp_path, points_cm):
    file = write(tmp_path / "k.pkl", {"keypoints3d": points_cm})
    truth, _ = keypoint_truth(file, CLIP, 0.01)
    assert np.isnan(truth.keypoints3d[1, 5]).all()
    assert np.isnan(truth.keypoints3d).sum() == 3


def test_frames_beyond_the_keypoints_are_told(tmp_path, points_cm):
    file = write(tmp_path / "k.pkl", {"keypoints3d": points_cm[:4]})
    truth, remarks = keypoint_truth(file, CLIP, 0.01)
    assert truth.frame_indices.tolist() == [2, 3]
    assert any("2 frames" in remark for remark in remarks)


def test_without_a_file_there_is_no_truth(tmp_path):
    truth, remarks = keypoint_truth(tmp_path / "k.pkl", CLIP, 0.01)
    assert truth is None
    assert "nothing is scored against joints" in remarks[0]


@pytest.mark.parametrize("content", [{"keypoints2d": np.zeros((9, 10, 17, 3))}, [1, 2],
                                     {"keypoints3d": np.zeros((10, 25, 3))}])  # fmt: skip
def test_other_contents_are_refused(tmp_path, content):
    with pytest.raises(InputError, match=r"k\.pkl"):
        keypoint_truth(write(tmp_path / "k.pkl", content), CLIP, 0.01)
