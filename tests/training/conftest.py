from __future__ import annotations

import pytest

from tests.one_thread import one_thread  # noqa: F401
from tests.toy_training import prepare, train, write_toy
from tests.two_ranks import TwoRanks


@pytest.fixture(scope="session")
def toy_folder(tmp_path_factory):
    return write_toy(tmp_path_factory.mktemp("scene") / "toy")


@pytest.fixture(scope="session")
def prepared(toy_folder):
    return prepare(toy_folder)


@pytest.fixture(scope="session")
def alone(prepared, tmp_path_factory):
    """The folder of an undisturbed run of one process, and its result."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    return folder, train(prepared, folder)


@pytest.fixture(scope="session")
def trained(alone):
    """The folder of an undisturbed run."""
    return alone[0]


@pytest.fixture(scope="session")
def two_ranks():
    ranks = TwoRanks()
    yield ranks
    ranks.close()
