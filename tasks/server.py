"""A Prefect server that is away, or being started again, stops no work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import httpx
from prefect.settings import PREFECT_CLIENT_MAX_RETRIES, temporary_settings


@contextmanager
def if_the_server_answers() -> Iterator[None]:
    """What is only shown or looked at: tried once, and left where nobody answers.

    Prefect itself would wait for a minute; the stage would stand still and its clock run.
    """
    with suppress(httpx.HTTPError), temporary_settings({PREFECT_CLIENT_MAX_RETRIES: 0}):
        yield
