"""Prefect as the command line uses it: in this process, quiet, without any server to set up."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager

SETTINGS = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "DO_NOT_TRACK": "1",
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "120",
    "PREFECT_API_BLOCKS_REGISTER_ON_START": "false",
    "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
}
NO_LOGS = {"PREFECT_LOGGING_LEVEL": "CRITICAL", "PREFECT_LOGGING_TO_API_ENABLED": "false"}
# The terminal shows progress bars; logs are read on the server's pages.
LOGS_ON_THE_SERVER = {"PREFECT_LOGGING_HANDLERS_CONSOLE_LEVEL": "CRITICAL"}


def set_environment() -> None:
    """Set what is not set. Prefect reads it when it is imported: call this before.

    A user's own environment wins: with PREFECT_API_URL set, runs and logs appear on that server.
    """
    own_server = "PREFECT_API_URL" in os.environ
    for name, value in (SETTINGS | (LOGS_ON_THE_SERVER if own_server else NO_LOGS)).items():
        os.environ.setdefault(name, value)


@contextmanager
def undisturbed() -> Iterator[None]:
    """No heartbeat, whose thread each flow waits for, and no remarks while events are sent."""
    logging.getLogger("EventsWorker").setLevel(logging.CRITICAL)
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    with temporary_settings(updates={PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}):
        yield
