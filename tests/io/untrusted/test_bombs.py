"""Small files that ask for much memory or time are refused before they get it."""

from __future__ import annotations

import bz2
import io
import lzma
import pickle
import resource
import time
import zipfile
import zlib
from pathlib import Path

import h5py
import joblib
import numpy as np
import pytest
import torch

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import Limits, read_untrusted
from tests.io.untrusted.valid_files import SPARSE
from tests.python2_pickle import Forged, python2_pickle

MEGABYTE = 2**20
# Small, so that the tests are cheap.
LIMITS = Limits(made_bytes=16 * MEGABYTE, free_growth_bytes=2 * MEGABYTE, steps=100_000)


@pytest.fixture
def refused(tmp_path):
    """Reads a file that must be refused, with little memory and quickly."""

    def check(data, match=None, limits=LIMITS):
        path = data if isinstance(data, Path) else tmp_path / "file"
        if path is not data:
            path.write_bytes(data)
        before, start = _peak_bytes(), time.process_time()
        with pytest.raises(InputError, match=match):
            read_untrusted(path, limits)
        assert _peak_bytes() - before < 256 * MEGABYTE
        assert time.process_time() - start < 3

    return check


def _peak_bytes():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _laughs(levels, leaf, close):
    """A list of ten times the list of ten times ..."""
    data = b"\x80\x02" + leaf
    for level in range(levels):
        data += b"q" + bytes([level]) + b"0(" + (b"h" + bytes([level])) * 10 + close
    return data + b"."


@pytest.mark.parametrize("close", [b"l", b"t"])
def test_lists_that_hold_one_list_again_and_again(refused, close):
    refused(_laughs(30, b"]", close), "at most 100,000 items")


def test_one_array_named_again_and_again(refused):
    array = pickle.dumps(np.zeros(MEGABYTE), 2)[2:-1]
    data = b"\x80\x02(" + array + b"r\xff\xff\x00\x00" + b"j\xff\xff\x00\x00" * 50 + b"l."
    refused(data, "must fit into", Limits(made_bytes=16 * MEGABYTE))


def test_keys_of_tuples_that_take_for_ever_to_hash(refused):
    nested = _laughs(60, b"(K\x01t", b"t")[:-1]
    refused(nested.replace(b"\x80\x02", b"\x80\x02}", 1) + b"Ns.", "text or whole numbers as keys")


def test_what_takes_for_ever_to_print_or_to_compare_is_neither(refused):
    endless = _laughs(60, b"(K\x01t", b"t")[2:-1]
    for use in (
        endless + b"U\x01a\x93",
        b"U\x02os" + endless + b"\x93",
        b"c_codecs\nencode\n(U\x01a" + endless + b"tR",
        b"cnumpy\ndtype\n(" + endless + b"tR",
        b"cnumpy\ndtype\n(U\x02f8tR(K\x03"
        + endless
        + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb",
        b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n" + endless + b"U\x01btR",
        b"ccollections\ndefaultdict\n(" + endless + b"tR",
        b"ccopy_reg\n_reconstructor\n(cchumpy.ch\nCh\n" + endless + b"NtR",
        b"cchumpy.ch\nCh\n" + endless + b"\x81",
        endless + b"Q",
    ):
        refused(b"\x80\x02" + use + b".")
    empty = io.BytesIO()
    torch.save(None, empty, _use_new_zipfile_serialization=False)
    listing = b"\x80\x02]q\x00."
    data = empty.getvalue()
    assert data.endswith(listing)
    refused(data.removesuffix(listing) + b"\x80\x02(" + endless + b"l.", "list of its tensors")


@pytest.mark.parametrize("depth", [100, 50_000])
def test_deep_nesting(refused, depth):
    refused(b"\x80\x02" + b"]" * depth + b"a" * (depth - 1) + b".", "nested at most 64 deep|items")


def test_a_structure_that_holds_itself(refused):
    own = []
    own.append(own)
    refused(pickle.dumps(own), "holds itself")
    refused(b"\x80\x02}q\x00Va\nh\x00s.", "holds itself")


def test_many_items(refused):
    refused(b"\x80\x02(" + b"}" * 200_000 + b"l.", "at most 100,000 items")
    refused(b"\x80\x04N" + b"\x94" * 200_000 + b".", "at most 100,000 items")


@pytest.mark.parametrize(
    "data",
    [
        b"\x80\x05\x96" + (2**40).to_bytes(8, "little"),  # a bytearray of a terabyte
        b"\x80\x04\x8e" + (2**62).to_bytes(8, "little"),
        b"\x80\x04\x8d" + b"\xff" * 8,
        b"\x80\x02B\xff\xff\xff\xff",
        b"\x80\x02T\xff\xff\xff\x7f",
        b"\x80\x04\x95" + b"\xff" * 8 + b".",
        b"\x80\x02\x8b\xff\xff\xff\x7f",
        b"\x80\x02\x8b\x00\x00\x01\x00" + b"\x7f" * 65536 + b".",  # a number of 65536 bytes
        b"I" + b"9" * 100_000 + b"\n.",
        b"(L" + b"9" * 100_000 + b"L\n.",
        b"(F" + b"9" * 100_000 + b"\n.",
        b"\x80\x02" + b"2" * 9,
        b"\x80\x02j\xff\xff\xff\xff.",
        b"\x80\x02.",
        b"\x80\x02e.",
        b"\x80\x02(.",
        b"\x80\x09N.",
        b"\x80\x02\xff.",
        b"\x80\x02cnumpy\nndarray\n.",
        b"\x80\x02cnumpy",
    ],
)
def test_lengths_and_places_that_are_not_there(refused, data):
    refused(data)


def test_a_memo_place_far_out_takes_no_memory(tmp_path):
    # The C unpickler would reserve a table of 2^31 places.
    (tmp_path / "file").write_bytes(b"\x80\x02]r\xff\xff\xff\x7f.")
    before = _peak_bytes()
    assert read_untrusted(tmp_path / "file") == []
    assert _peak_bytes() - before < 16 * MEGABYTE


@pytest.mark.parametrize(
    "pack",
    [
        zlib.compress,
        bz2.compress,
        lzma.compress,
        lambda data: lzma.compress(data, lzma.FORMAT_ALONE),
    ],
)
def test_compressed_files_that_grow_without_end(refused, pack):
    refused(pack(bytes(6 * MEGABYTE)), "must fit into")


def test_archives_that_grow_without_end(refused):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(6 * MEGABYTE))
    refused(file.getvalue(), "must fit into")


def test_what_lies_in_a_file_as_it_is_may_be_larger_than_what_is_made(tmp_path):
    big = np.zeros(LIMITS.made_bytes // 8 + 1)
    torch.save({"a": torch.from_numpy(big)}, tmp_path / "big.pt")
    np.savez(tmp_path / "big.npz", a=big)
    joblib.dump({"a": big}, tmp_path / "big.pkl")
    for path in tmp_path.iterdir():
        assert read_untrusted(path, LIMITS)["a"].nbytes > LIMITS.made_bytes


def test_one_entry_of_an_archive_listed_under_many_names(refused):
    array = io.BytesIO()
    np.save(array, np.zeros(MEGABYTE // 8))
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("00.npy", array.getvalue())
        for number in range(1, 40):
            # The directory points to the first entry again, whose name is then wrong.
            again = zipfile.ZipInfo(f"{number:02}.npy")
            first = archive.infolist()[0]
            again.CRC, again.file_size, again.compress_size = (
                first.CRC,
                first.file_size,
                first.compress_size,
            )
            again.header_offset = 0
            archive.filelist.append(again)
            archive.NameToInfo[again.filename] = again
    refused(file.getvalue())


def test_many_members_that_grow_a_little(refused):
    file = io.BytesIO()
    array = io.BytesIO()
    np.save(array, np.zeros(MEGABYTE // 8))
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(20):
            archive.writestr(f"{number}.npy", array.getvalue())
    refused(file.getvalue(), "must fit into")


def test_shapes_in_headers_that_the_file_does_not_hold(refused):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (%d,), }\n"
    for size in (2**30, 2**61, 10**30):
        text = header % size
        refused(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(64))
    refused(b"\x93NUMPY\x02\x00\xff\xff\xff\x7f", "header of")
    refused(b"\x93NUMPY\x01\x00\x10\x00" + b"(" * 16)


def test_joblib_arrays_that_the_file_does_not_hold(refused):
    file = io.BytesIO()
    joblib.dump(np.zeros(1), file)
    huge = file.getvalue().replace(b"K\x01\x85", b"J\xff\xff\xff\x7f\x85", 1)
    refused(huge, "bytes declared")


def test_tensors_beyond_or_far_larger_than_their_storage(refused, tmp_path):
    torch.save(torch.zeros(1).expand(10**9), tmp_path / "repeated.pt")
    refused(tmp_path / "repeated.pt", "must fit into")
    for tensor in (torch.zeros(3), torch.zeros(2, 2)):
        file = io.BytesIO()
        torch.save(tensor, file, _use_new_zipfile_serialization=False)
        refused(
            file.getvalue()
            .replace(b"K\x02\x86", b"M\xff\x7f\x86")
            .replace(b"K\x03\x85", b"M\xff\x7f\x85")
        )


def test_sparse_matrices_that_would_be_vast(refused):
    state = SPARSE | {"_shape": (10**9, 3)}
    refused(python2_pickle(Forged("scipy.sparse.csc", "csc_matrix", state)), "must fit into")
    for fault in (
        {"_shape": (2, 2)},
        {"_shape": 3},
        {"data": np.zeros(3, complex)},
        {"indices": np.array([0, 9, 0])},
        {"indptr": np.array([0, 3, 1, 3])},
        {"data": 1},
    ):
        refused(python2_pickle(Forged("scipy.sparse.csc", "csc_matrix", SPARSE | fault)))


def test_sparse_columns_whose_differences_wrap_round(refused):
    far = {"indptr": np.array([0, 2**62, -(2**63), -(2**62), 3]), "_shape": (2, 4)}
    refused(python2_pickle(Forged("scipy.sparse.csc", "csc_matrix", SPARSE | far)), "out of order")
    fractions = {"indptr": np.array([0.0, 1.0, np.nan, 3.0])}
    refused(python2_pickle(Forged("scipy.sparse.csc", "csc_matrix", SPARSE | fractions)))


@pytest.mark.parametrize("rows", [10**6, 2**40])
def test_arrays_of_objects_that_are_rows_of_nothing(refused, rows):
    shape = pickle.dumps(rows, 2)[2:-1]
    array = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(K\x00tU\x01btR"
    state = b"(K\x01(" + shape + b"K\x00tcnumpy\ndtype\n(U\x01OtR\x89]tb"
    refused(b"\x80\x02" + array + state + b".", "must fit into")


TYPE = b"cnumpy\ndtype\n(U\x02u1tRq\x02"
SIZE = b"J" + MEGABYTE.to_bytes(4, "little")
STATE = b"(K\x01(" + SIZE + b"tcnumpy\ndtype\n(U\x02u1tR\x89h\x01t"
EMPTY = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(K\x00tU\x01btR"


@pytest.mark.parametrize(
    "again",
    [
        b"cnumpy._core.numeric\n_frombuffer\n(h\x01h\x02(" + SIZE + b"tU\x01CtR",
        b"ctorch.storage\n_load_from_bytes\n(h\x03tR",
        b"c_codecs\nencode\n(h\x04U\x06latin1tR",
        b"c__builtin__\nset\n(h\x05tR",
        b"ccollections\nOrderedDict\n(h\x06tR",
        EMPTY + b"h\x07b",
    ],
)
def test_bytes_and_lists_that_are_copied_again_and_again(refused, again):
    tensor = io.BytesIO()
    torch.save(torch.zeros(MEGABYTE // 4).storage(), tensor, _use_new_zipfile_serialization=False)
    kept = (
        b"B" + MEGABYTE.to_bytes(4, "little") + bytes(MEGABYTE) + b"q\x010",
        TYPE + b"0",
        b"B" + len(tensor.getvalue()).to_bytes(4, "little") + tensor.getvalue() + b"q\x030",
        b"X" + MEGABYTE.to_bytes(4, "little") + bytes(MEGABYTE) + b"q\x040",
        b"(" + b"N" * 20_000 + b"lq\x050",
        b"(" + b"(U\x01aNl" * 5_000 + b"lq\x060",
        STATE + b"q\x070",
    )
    data = b"\x80\x02" + b"".join(kept) + b"(" + again * 400 + b"l."
    refused(data, "must fit into|at most 100,000 items")


def test_numbers_of_an_array_that_share_their_bytes(refused):
    wide = b"cnumpy\ndtype\n(U\x08S1048576tRq\x02"
    blob = b"B" + MEGABYTE.to_bytes(4, "little") + b"a" * MEGABYTE + b"q\x010"
    number = b"cnumpy.core.multiarray\nscalar\n(h\x02h\x01tR"
    refused(b"\x80\x02" + blob + wide + b"0(" + number * 400 + b"l.", "must fit into")


@pytest.mark.parametrize("kind", [b"U999999999", b"S999999999"])
def test_types_wider_than_numpy_has(refused, kind):
    refused(b"\x80\x02cnumpy\ndtype\n(U" + bytes([len(kind)]) + kind + b"tR.", "numbers or text")
    text = b"{'descr': '<" + kind + b"', 'fortran_order': False, 'shape': (0,), }\n"
    refused(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text, "numbers or text")


@pytest.mark.parametrize("item", [b"]", b"}", b"\x94", b"]\x85"])
def test_memory_for_items_grows_with_the_file(refused, item):
    # By default: a small file may hold no more than a large one could.
    mark, close = (b"N", b".") if item == b"\x94" else (b"(", b"l.")
    limits = Limits(free_growth_bytes=2 * MEGABYTE, steps=100_000)
    refused(b"\x80\x04" + mark + item * (40_000 // len(item)) + close, "must fit into", limits)


def test_hdf5_data_that_would_be_vast(refused, tmp_path):
    with h5py.File(tmp_path / "vast.hdf5", "w") as file:
        file.create_dataset("masks", (10**6, 1080, 1080), "i1", chunks=(1, 64, 64))
    refused(tmp_path / "vast.hdf5", "must fit into")
    with h5py.File(tmp_path / "chunk.hdf5", "w") as file:
        file.create_dataset("a", (4,), "i1", chunks=(2**31,), maxshape=(None,))
    refused(tmp_path / "chunk.hdf5", "chunks of")
