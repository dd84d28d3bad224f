"""A server that does not answer, on a port that nobody listens at."""

from __future__ import annotations

import time
from uuid import uuid4

import pytest
from prefect.client.orchestration import get_client
from prefect.settings import PREFECT_API_URL, temporary_settings

from tasks.server import if_the_server_answers
from tests.free_port import free_port


@pytest.fixture
def nobody():
    with temporary_settings({PREFECT_API_URL: f"http://127.0.0.1:{free_port()}/api"}):
        yield


def test_what_is_only_shown_is_left_out_at_once_where_the_server_is_away(nobody):
    client = get_client(sync_client=True)
    client._client._has_connected = True  # As in mid-run, when Prefect would wait for it.
    begun = time.monotonic()
    with if_the_server_answers():
        client.read_flow_run(uuid4())
        pytest.fail("nobody can have answered")
    assert time.monotonic() - begun < 10.0


def test_other_errors_are_not_swallowed(nobody):
    with pytest.raises(ZeroDivisionError), if_the_server_answers():
        _ = 1 / 0
