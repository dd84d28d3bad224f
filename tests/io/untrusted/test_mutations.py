"""A changed file gives a plain structure or a clear error, never anything else."""

from __future__ import annotations

from contextlib import suppress
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import Limits, read_untrusted
from tests.io.untrusted.mutations import KINDS, Edit, edited, impure, inside
from tests.io.untrusted.random_pickles import random_pickle
from tests.io.untrusted.valid_files import write_valid_files

LIMITS = Limits(made_bytes=2**26, free_growth_bytes=2**24, steps=100_000, seconds=5)
EDITS = st.lists(
    st.builds(Edit, st.sampled_from(KINDS), st.floats(0, 0.999), st.integers(0, 2**32 - 1)),
    min_size=1,
    max_size=8,
)
SHORT = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return write_valid_files(tmp_path_factory.mktemp("valid"))


def _read(path, data):
    path.write_bytes(data)
    with suppress(InputError):
        assert impure(read_untrusted(path, LIMITS)) == []


@pytest.mark.parametrize(
    "name", ["python2_2.pkl", "protocol_4.pkl", "protocol_5.pkl", "joblib.pkl"]
)
@SHORT
@given(EDITS)
def test_changed_pickles(files, tmp_path, name, edits):
    data = next(path for path in files if path.name == name).read_bytes()
    _read(tmp_path / "file", edited(data, edits, files[0].read_bytes()))


@SHORT
@given(EDITS, st.data())
def test_changed_files_of_numpy_and_torch(files, tmp_path, edits, data):
    path = data.draw(st.sampled_from([f for f in files if f.suffix in (".npy", ".npz", ".pt")]))
    _read(tmp_path / "file", edited(path.read_bytes(), edits, files[0].read_bytes()))


@SHORT
@given(EDITS, st.data())
def test_changes_inside_of_packed_files(files, tmp_path, edits, data):
    packed = [f for f in files if f.suffix in (".npz", ".pt") or "joblib_" in f.name]
    content, pack = inside(data.draw(st.sampled_from(packed)))
    _read(tmp_path / "file", pack(edited(content, edits, files[0].read_bytes())))


@settings(SHORT, max_examples=3)
@given(EDITS)
def test_changed_hdf5_files(files, tmp_path, edits):
    data = next(path for path in files if path.suffix == ".hdf5").read_bytes()
    _read(tmp_path / "file", edited(data, edits, data))


@settings(SHORT, max_examples=200)
@given(st.integers(0, 2**32))
def test_random_instructions(tmp_path, seed):
    _read(tmp_path / "file", random_pickle(Random(seed)))
