"""HDF5 files that lead elsewhere, hold more than numbers, or kill the library that reads them."""

from __future__ import annotations

import os

import h5py
import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import Limits, hdf5_file, hdf5_rows, hdf5_shapes, read_hdf5

SECRET = b"a secret of sixteen bytes or so "


@pytest.fixture
def secret(tmp_path):
    path = tmp_path / "secret"
    path.write_bytes(SECRET)
    return path


def _external_link(file, secret):
    with h5py.File(secret.with_suffix(".hdf5"), "w") as other:
        other["a"] = np.frombuffer(SECRET, np.uint8)
    file["a"] = h5py.ExternalLink(str(secret.with_suffix(".hdf5")), "/a")


def _soft_link(file, secret):
    file["b"] = np.zeros(3)
    file["a"] = h5py.SoftLink("/b")


def _dangling_link(file, secret):
    file["a"] = h5py.SoftLink("/nowhere")


def _other_file(file, secret):
    file.create_dataset("a", (32,), "u1", external=[(str(secret), 0, 32)])


def _virtual(file, secret):
    with h5py.File(secret.with_suffix(".hdf5"), "w") as other:
        other["a"] = np.frombuffer(SECRET, np.uint8)
    layout = h5py.VirtualLayout((32,), "u1")
    layout[:] = h5py.VirtualSource(str(secret.with_suffix(".hdf5")), "a", (32,))
    file.create_virtual_dataset("a", layout)


def _virtual_without_end(file, secret):
    # Who asks for its shape opens the source, and whoever opens that one waits for ever.
    os.mkfifo(secret.with_suffix(".hdf5"))
    layout = h5py.VirtualLayout((4,), "u1", maxshape=(None,))
    source = h5py.VirtualSource(str(secret.with_suffix(".hdf5")), "a", (4,), maxshape=(None,))
    layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
    file.create_virtual_dataset("a", layout)


def _text_of_any_length(file, secret):
    file["a"] = ["one", "another"]


def _lists_of_any_length(file, secret):
    file.create_dataset("a", (2,), h5py.vlen_dtype(np.int32))


def _references(file, secret):
    file.create_dataset("a", (1,), h5py.ref_dtype)


def _fields(file, secret):
    file["a"] = np.zeros(2, [("x", "f4"), ("y", "i4")])


def _nothing(file, secret):
    file["a"] = h5py.Empty("f4")


def _circle(file, secret):
    file.create_group("a")["a"] = file["/"]


def _twice(file, secret):
    file["b"] = np.zeros(3)
    file["a"] = file["b"]


HOSTILE = [
    _external_link,
    _soft_link,
    _dangling_link,
    _other_file,
    _virtual,
    _virtual_without_end,
    _text_of_any_length,
    _lists_of_any_length,
    _references,
    _fields,
    _nothing,
    _circle,
    _twice,
]


@pytest.mark.parametrize("write", HOSTILE)
def test_what_is_no_plain_data_is_refused(tmp_path, secret, write):
    path = tmp_path / "file.hdf5"
    with h5py.File(path, "w") as file:
        write(file, secret)
    with pytest.raises(InputError, match=r"file\.hdf5 must hold .*'(a|b)"):
        read_hdf5(path, Limits(seconds=10))


def test_shapes_and_rows_follow_no_links_either(tmp_path, secret):
    path = tmp_path / "file.hdf5"
    with h5py.File(path, "w") as file:
        _external_link(file, secret)
    for read in (hdf5_shapes, lambda path: list(hdf5_rows(path, "a", [0]))):
        with pytest.raises(InputError, match="a link to elsewhere"):
            read(path)


def test_the_library_may_not_load_filters_from_elsewhere(tmp_path):
    with h5py.File(tmp_path / "file.hdf5", "w") as file:
        # An optional filter that is not there is skipped in writing, and sought in reading.
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((4,))
        plist.set_filter(305, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((4,))
        h5py.h5d.create(file.id, b"a", h5py.h5t.NATIVE_INT8, space, plist)
    with pytest.raises(InputError, match="unknown filter 305"):
        read_hdf5(tmp_path / "file.hdf5")


def test_a_reading_process_that_dies_or_hangs_is_an_error(tmp_path, monkeypatch):
    path = tmp_path / "file.hdf5"
    with h5py.File(path, "w") as file:
        file["a"] = np.zeros(4)
    endings = {
        "dies": "import os; os.abort()",
        "hangs": "import resource as r; r.setrlimit(r.RLIMIT_CPU, (1, 1))\nwhile True: pass",
        "waits": "import time; time.sleep(60)",
        "lingers": "import os, time; os.close(1); time.sleep(60)",
        "babbles": "print('no json')",
        "counts": "print(1)",
        "lies": 'print(\'{"name": "a", "dtype": "<f8", "shape": [4]}\')',
        "boasts": 'print(\'{"name": "a", "dtype": "<f8", "shape": [99999999999]}\')',
        "smuggles": 'print(\'{"name": "a", "dtype": "O", "shape": [1]}\' + "12345678")',
    }
    for name, code in endings.items():
        program = tmp_path / f"{name}.py"
        program.write_text(code)
        monkeypatch.setattr(hdf5_file, "_PROGRAM", program)
        with pytest.raises(InputError):
            read_hdf5(path, Limits(made_bytes=2**20, seconds=1))
