"""One S3 server for all tests of the store."""

from __future__ import annotations

import pytest
import s3fs

from tests.object_storage import object_storage


@pytest.fixture(scope="session")
def storage():
    with object_storage() as made:
        yield made


@pytest.fixture
def reachable(storage, monkeypatch):
    """The same, where this process finds it at ``s3://...``."""
    for name, value in storage.environment.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()  # Its instances remember the environment.
    return storage
