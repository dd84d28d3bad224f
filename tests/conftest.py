"""One Prefect server for the whole session, started only by the tests that ask for it."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile

import pytest

# Nothing that a user has is read or written: neither their cache nor their Prefect.
HOME = tempfile.mkdtemp(prefix="mocoflow-tests-")
atexit.register(shutil.rmtree, HOME, ignore_errors=True)

# Prefect reads its settings when it is imported.
os.environ |= {
    "XDG_CACHE_HOME": f"{HOME}/cache",
    "XDG_STATE_HOME": f"{HOME}/state",
    "PREFECT_HOME": f"{HOME}/prefect",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "DO_NOT_TRACK": "1",
    "PREFECT_LOGGING_TO_API_ENABLED": "false",
    "PREFECT_LOGGING_LEVEL": "CRITICAL",
    "PREFECT_API_BLOCKS_REGISTER_ON_START": "false",
    # As many processes test as there are cores.
    "OMP_NUM_THREADS": "1",
}


@pytest.fixture(scope="session")
def prefect_server(tmp_path_factory):
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, PREFECT_HOME, temporary_settings
    from prefect.testing.utilities import prefect_test_harness

    home = {PREFECT_HOME: tmp_path_factory.mktemp("prefect")}
    with (
        temporary_settings(updates=home),
        prefect_test_harness(server_startup_timeout=120),
        temporary_settings(updates={PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}),
    ):
        yield
