"""Every kind of file comes back as the plain structure that went in."""

from __future__ import annotations

import pickle

import h5py
import joblib
import numpy as np
import pytest
import scipy.sparse
import torch

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import (
    hdf5_rows,
    hdf5_shapes,
    read_hdf5,
    read_joblib,
    read_npy,
    read_npz,
    read_pickle,
    read_torch,
    read_untrusted,
)
from tests.io.untrusted.same import same
from tests.io.untrusted.valid_files import PLAIN, TENSORS, TRACK, write_valid_files
from tests.python2_pickle import Forged, python2_pickle


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return {path.name: path for path in write_valid_files(tmp_path_factory.mktemp("valid"))}


@pytest.mark.parametrize("protocol", range(6))
def test_pickles_of_every_protocol(files, protocol):
    assert same(read_pickle(files[f"protocol_{protocol}.pkl"]), PLAIN)


@pytest.mark.parametrize("protocol", range(3))
def test_pickles_of_python_2_with_arrays_of_packages_that_are_not_there(files, protocol):
    found = read_untrusted(files[f"python2_{protocol}.pkl"])

    assert same(found["track"], PLAIN | {"names": ["a"]})
    assert same(found["state"], np.arange(6.0))
    assert same(found["sparse"], np.array([[0.5, 0, 1.0], [0, 0.5, 0]]))


@pytest.mark.parametrize("ending", ["", "_zlib", "_gzip", "_bz2", "_xz", "_lzma"])
def test_joblib_files_compressed_or_not(files, ending):
    path = files[f"joblib{ending}.pkl"]

    assert same(read_joblib(path), {1: PLAIN, 7: PLAIN})
    assert same(read_untrusted(path), {1: PLAIN, 7: PLAIN})


def test_joblib_files_before_alignment(tmp_path):
    # joblib 1.1 wrote wrappers without an alignment and no fill bytes.
    path = tmp_path / "old.pkl"
    array = np.arange(5.0)
    wrapper = joblib.numpy_pickle.NumpyArrayWrapper(np.ndarray, (5,), "C", array.dtype)
    del wrapper.numpy_array_alignment_bytes
    path.write_bytes(pickle.dumps(wrapper, 2)[:-1] + array.tobytes() + b".")

    assert same(read_untrusted(path), array)


def test_arrays_of_objects_become_lists_and_those_without_axes_their_item(files, tmp_path):
    grid = np.empty((2, 2), object, order="F")
    grid[:] = [[1, "a"], [None, {"k": 2}]]
    np.save(tmp_path / "grid.npy", grid)

    assert same(read_npy(files["objects.npy"]), PLAIN)
    assert same(read_npy(tmp_path / "grid.npy"), [[1, "a"], [None, {"k": 2}]])
    assert same(read_npy(files["numbers.npy"]), TRACK["pose"])


def test_archives_of_arrays(files):
    assert same(read_npz(files["stored.npz"]), {"pose": TRACK["pose"], "results": PLAIN})
    names = np.array(["a", "bc"])
    assert same(read_untrusted(files["deflated.npz"]), {"pose": TRACK["pose"], "names": names})


def test_tensors_become_arrays_wherever_they_lie(files):
    arrays = {name: tensor.float().numpy() for name, tensor in TENSORS.items()}
    arrays["turned"] = TENSORS["turned"].numpy()

    assert same(read_torch(files["zip.pt"]), {"smpl": arrays, "K": np.eye(3, dtype=np.float32)})
    assert same(read_torch(files["old.pt"]), arrays)
    assert same(read_untrusted(files["tensors.npy"]), arrays)


@pytest.mark.parametrize("zipped", [True, False])
def test_state_dicts_of_modules_are_their_tensors(tmp_path, zipped):
    module = torch.nn.Sequential(torch.nn.Linear(2, 3), torch.nn.BatchNorm1d(3))
    path = tmp_path / "weights.pth"
    torch.save(module.state_dict(), path, _use_new_zipfile_serialization=zipped)

    found = read_torch(path)

    assert list(found) == list(module.state_dict())
    assert all((found[name] == value.numpy()).all() for name, value in module.state_dict().items())


def test_other_attributes_of_a_dict_are_refused(tmp_path):
    weights = torch.nn.Linear(2, 3).state_dict()
    weights.more = 1
    torch.save(weights, tmp_path / "weights.pth")

    with pytest.raises(InputError, match="a state for something that has none"):
        read_torch(tmp_path / "weights.pth")


def test_tensors_that_share_memory_become_arrays_of_their_own(tmp_path):
    whole = torch.arange(6.0)
    torch.save([whole, whole[2:4]], tmp_path / "shared.pt")

    first, second = read_torch(tmp_path / "shared.pt")
    first[:] = 0

    assert same(second, np.array([2, 3], np.float32))


@pytest.mark.parametrize("version", ["earliest", "latest"])
def test_hdf5_files(files, version):
    found = read_hdf5(files[f"{version}.hdf5"])

    assert set(found) == {"masks", "pose", "betas", "group/trans"}
    assert found["masks"].dtype == np.int8
    assert found["masks"].sum() == 512
    assert same(found["pose"], np.ones((5, 72), np.float32))


def test_rows_of_an_hdf5_file_come_as_they_are_asked_for(files):
    path = files["latest.hdf5"]
    assert hdf5_shapes(path)["masks"].shape == (4, 16, 16)
    assert [row[0] for row in hdf5_rows(path, "group/trans", [1, 0])] == [3.0, 0.0]
    with pytest.raises(InputError, match="row 2"):
        list(hdf5_rows(path, "group/trans", [0, 2]))
    with pytest.raises(InputError, match="must hold 'mask', got betas, group/trans, masks, pose"):
        list(hdf5_rows(path, "mask", [0]))


def test_arrays_are_writable_and_in_native_order(tmp_path):
    for write in (
        lambda path, value: path.write_bytes(pickle.dumps(value)),
        lambda path, value: joblib.dump(value, path),
    ):
        write(tmp_path / "file", np.arange(3, dtype=">f4"))
        found = read_untrusted(tmp_path / "file")
        assert same(found, np.arange(3, dtype=np.float32))
        found[0] = 5


def test_numbers_of_python_2_and_of_protocol_2_keep_their_value(tmp_path):
    values = [0, -1, 255, 65536, 2**31, 2**40, -(2**70), 1e300, True, False, b"", b"\xff", "ü", ()]
    (tmp_path / "file").write_bytes(pickle.dumps(values, 2))

    assert same(read_untrusted(tmp_path / "file"), values)


def test_a_chumpy_expression_without_an_array_is_what_it_holds(tmp_path):
    inner = Forged("chumpy.ch", "Ch", {"x": np.ones(2)})
    state = {"a": inner, "idxs": [0]}
    content = {"J": Forged("chumpy.reordering", "Select", state)}
    (tmp_path / "file").write_bytes(python2_pickle(content))

    assert same(read_untrusted(tmp_path / "file"), {"J": {"a": np.ones(2), "idxs": [0]}})


@pytest.mark.parametrize("protocol", [2, 5])
def test_sparse_matrices_of_the_scipy_that_is_installed(tmp_path, protocol):
    dense = np.array([[0.0, 1, 0], [2, 0, 3]])
    (tmp_path / "file").write_bytes(pickle.dumps(scipy.sparse.csc_matrix(dense), protocol))

    assert same(read_untrusted(tmp_path / "file"), dense)


def test_shared_parts_are_read_once_and_stay_equal(tmp_path):
    shared = {"K": np.eye(3)}
    (tmp_path / "file").write_bytes(pickle.dumps([shared] * 3))

    assert same(read_untrusted(tmp_path / "file"), [shared] * 3)


def test_text_and_nothing_are_told_from_data_files(tmp_path):
    for content in (b"", b"frame,x,y\n1,2,3\n", b"\x00" * 100, b"PK\x05\x06"):
        (tmp_path / "file").write_bytes(content)
        with pytest.raises(InputError, match="must be a pickle, joblib, NumPy, torch or HDF5"):
            read_untrusted(tmp_path / "file")


def test_missing_files_and_folders_are_named(tmp_path):
    with pytest.raises(InputError, match="nowhere must be a file, got none"):
        read_untrusted(tmp_path / "nowhere")
    with pytest.raises(InputError, match="must be a file, got a folder"):
        read_hdf5(tmp_path)


def test_a_file_that_is_another_kind_than_asked_for_is_an_error(files):
    for read, name in (
        (read_pickle, "numbers.npy"),
        (read_npy, "joblib.pkl"),
        (read_npz, "objects.npy"),
        (read_npz, "zip.pt"),
        (read_torch, "deflated.npz"),
        (read_torch, "joblib.pkl"),
        (read_hdf5, "zip.pt"),
    ):
        with pytest.raises(InputError):
            read(files[name])


def test_h5py_and_ours_agree_on_every_number(files):
    with h5py.File(files["latest.hdf5"]) as file:
        expected = {name: file[name][()] for name in ("masks", "pose", "betas", "group/trans")}
    expected["pose"] = expected["pose"].astype(np.float32)

    assert same(read_untrusted(files["latest.hdf5"]), expected)
