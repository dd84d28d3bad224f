"""A Prefect server that is away, or being started again, stops no work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import httpx
from prefect.context import SettingsContext, get_settings_context


@contextmanager
def if_the_server_answers() -> Iterator[None]:
    """What is only shown or looked at: tried once, and left where nobody answers.

    Prefect itself would wait for a minute; the stage would stand still and its clock run. Its
    ``temporary_settings`` checks every setting again, 70 ms that each show of progress would cost.
    """
    now = get_settings_context()
    client = now.settings.client.model_copy(update={"max_retries": 0})
    once = now.settings.model_copy(update={"client": client})
    with suppress(httpx.HTTPError), SettingsContext(profile=now.profile, settings=once):
        yield
