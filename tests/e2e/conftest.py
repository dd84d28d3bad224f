"""One server with one worker for all end-to-end tests, and a scene for them."""

from __future__ import annotations

import pytest

from mocoflow_core.synthetic.toy import write_toy_scene
from tests.e2e.production import available_database, production


@pytest.fixture(scope="session")
def deployed(tmp_path_factory):
    """On SQLite only where there is no PostgreSQL."""
    files, database = tmp_path_factory.getbasetemp(), available_database()
    with production(tmp_path_factory.mktemp("production"), files, database) as made:
        yield made


@pytest.fixture(scope="session")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes") / "toy"
    write_toy_scene(folder)
    return folder
