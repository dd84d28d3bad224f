"""The truth is a stranger's file: read as data, checked before anything is measured."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.methods.truth_file import read_truth

SOUND = {
    "frame_indices": np.arange(2),
    "vertices": np.zeros((2, 4, 3), np.float32),
    "faces": np.array([[0, 1, 3]]),
    "keypoints3d": np.full((2, 17, 3), np.nan),
}


def test_what_was_written_is_read(tmp_path):
    np.savez(tmp_path / "truth.npz", **SOUND)
    truth = read_truth(tmp_path / "truth.npz")
    assert all(np.array_equal(truth[name], SOUND[name], equal_nan=True) for name in SOUND)


@pytest.mark.parametrize(
    "fault",
    [
        {"frame_indices": np.arange(3)},
        {"frame_indices": np.array([0.5, 1.5])},
        {"vertices": np.zeros((2, 4, 2))},
        {"vertices": np.array(["a", "b"])},
        {"faces": np.array([[0, 1, 4]])},
        {"keypoints3d": np.zeros((2, 18, 3))},
        {"keypoints3d": np.array([{}, {}], object)},
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(tmp_path, fault):
    np.savez(tmp_path / "truth.npz", **SOUND | fault)
    with pytest.raises(InputError, match=r"truth\.npz must hold"):
        read_truth(tmp_path / "truth.npz")


def test_a_header_larger_than_its_file_is_bad_input(tmp_path):
    array = io.BytesIO()
    np.save(array, np.zeros((2, 3)))
    with zipfile.ZipFile(tmp_path / "truth.npz", "w") as archive:
        archive.writestr("vertices.npy", array.getvalue().replace(b"(2, 3)", b"(9999999999999, 3)"))
    with pytest.raises(InputError):
        read_truth(tmp_path / "truth.npz")
