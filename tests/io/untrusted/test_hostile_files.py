"""Files that try to run, to read or to fill something are refused, and nothing happens."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import pickle
import zipfile
import zlib

import joblib
import numpy as np
import pytest
import torch

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_untrusted
from tests.io.untrusted.hostile_pickles import FORBIDDEN, Calling, creating

PACKING = {
    "plain": lambda data: data,
    "zlib": zlib.compress,
    "gzip": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
    "npy": lambda data: _npy(data),
    "npz": lambda data: _zip({"results.npy": _npy(data)}),
    "torch": lambda data: _zip({"archive/data.pkl": data, "archive/version": b"3\n"}),
    "old_torch": lambda data: _old_torch(data),
    "nested_torch": lambda data: pickle.dumps(Calling(_load_from_bytes, _old_torch(data)), 2),
    "joblib_objects": lambda data: _joblib_objects(data),
}
_load_from_bytes = torch.storage._load_from_bytes


def _npy(data):
    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (), }\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


def _zip(members, method=zipfile.ZIP_DEFLATED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return file.getvalue()


def _old_torch(data):
    file = io.BytesIO()
    torch.save(None, file, _use_new_zipfile_serialization=False)
    return file.getvalue().replace(pickle.dumps(None, 2), data, 1)


def _joblib_objects(data):
    file = io.BytesIO()
    joblib.dump(np.array([None, None]), file)
    whole = file.getvalue()
    return whole[: whole.rindex(b"\x80\x05")] + data


def _refused(path, data, match=None):
    path.write_bytes(data)
    with pytest.raises(InputError, match=match) as caught:
        read_untrusted(path)
    assert str(path) in str(caught.value)
    return caught.value


def test_the_hostile_pickles_would_run(tmp_path):
    sentinel = tmp_path / "sentinel"
    for name in ("system_2", "eval_5", "inst", "obj", "stack_global"):
        pickle.loads(creating(sentinel)[name])
        sentinel.unlink()


@pytest.mark.parametrize("container", PACKING)
def test_nothing_runs_in_any_container(tmp_path, container):
    sentinel = tmp_path / "sentinel"
    for data in creating(sentinel).values():
        _refused(tmp_path / "file", PACKING[container](data))
        assert not sentinel.exists()


@pytest.mark.parametrize("container", sorted(PACKING.keys() - {"nested_torch", "joblib_objects"}))
def test_the_same_containers_are_read_with_data_in_them(tmp_path, container):
    data = PACKING[container](pickle.dumps({"a": 1}, 2))
    (tmp_path / "file").write_bytes(data)
    found = read_untrusted(tmp_path / "file")
    assert found == ({"results": {"a": 1}} if container == "npz" else {"a": 1})


def test_the_forbidden_name_and_what_may_stand_there_are_said(tmp_path):
    data = creating(tmp_path / "sentinel")["system_5"]
    error = _refused(tmp_path / "file", data, "may hold only numbers, text, lists, dicts")
    assert "'posix.system'" in error.got
    assert "nothing of it ran" in error.action


@pytest.mark.parametrize("name", FORBIDDEN)
def test_names_outside_the_table_and_odd_uses_of_those_within_are_refused(tmp_path, name):
    _refused(tmp_path / "file", FORBIDDEN[name])


def test_joblib_arrays_of_objects_are_refused(tmp_path):
    joblib.dump({"a": np.array([{}, []], object)}, tmp_path / "file")
    with pytest.raises(InputError, match="Python objects"):
        read_untrusted(tmp_path / "file")


@pytest.mark.parametrize(
    "state",
    [
        ((0,), np.dtype("f8"), False, b""),  # wrong length of the state
        (1, (2,), np.dtype("f8"), False, b"1234567"),  # fewer bytes than the shape needs
        (1, (0,), np.dtype("f8"), False, b"12345678"),
        (1, (2**40, 2**40), np.dtype("f8"), False, b""),
        (1, (0, 2**61), np.dtype("f8"), False, b""),
        (1, (-1,), np.dtype("f8"), False, b""),
        (1, ("1",), np.dtype("f8"), False, b"12345678"),
        (1, (1,), "f8", False, b"12345678"),
        (1, (1,), np.dtype("O"), False, b"12345678"),  # a pointer of the file's choice
        (1, (2,), np.dtype("O"), False, [None]),
        (1, (1,), np.dtype([("a", "f8")]), False, b"12345678"),
        (1, (1,), np.dtype("M8[s]"), False, b"12345678"),
        (1, (1,), np.dtype("V8"), False, b"12345678"),
        (1, (1,) * 40, np.dtype("f8"), False, b"12345678"),
    ],
)
def test_arrays_that_are_not_what_they_declare_are_refused(tmp_path, state):
    made = Calling(np._core.multiarray._reconstruct, np.ndarray, (0,), b"b")
    made.call = (*made.call, state)
    _refused(tmp_path / "file", pickle.dumps(made, 4))


@pytest.mark.parametrize(
    "arguments",
    [
        (np.matrix, (0,), b"b"),
        (np.recarray, (0,), b"b"),
        (np.ndarray, (9,), b"b"),
        (dict, (0,), b"b"),
    ],
)
def test_arrays_are_made_in_one_way_only(tmp_path, arguments):
    made = Calling(np._core.multiarray._reconstruct, *arguments)
    _refused(tmp_path / "file", pickle.dumps(made, 2))


def test_links_and_paths_out_of_archives_are_refused(tmp_path):
    array = io.BytesIO()
    np.save(array, np.zeros(3))
    for name in ("../a.npy", "/etc/a.npy", "a/../../b.npy", "C:\\a.npy", "..\\a.npy"):
        _refused(tmp_path / "file", _zip({name: array.getvalue()}), "leads outside")
    link = zipfile.ZipInfo("a.npy")
    link.external_attr = 0o120777 << 16
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(link, "/etc/hostname")
    _refused(tmp_path / "file", file.getvalue(), "symbolic link")


def test_archives_with_foreign_or_double_entries_are_refused(tmp_path):
    _refused(tmp_path / "file", _zip({"run.sh": b"true"}), "must hold arrays only")
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.npy", b"")
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("a.npy", b"")
    _refused(tmp_path / "file", file.getvalue(), "two entries of one name")
