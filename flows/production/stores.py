"""The bucket or folder of the workers' store, made before the first run."""

from __future__ import annotations

import os

from flows.allowed_folders import STORE
from mocoflow_core.errors import InputError
from mocoflow_core.io.remote_store import file_system
from mocoflow_core.io.retry import persistent


def make_store() -> None:
    """Make the place of ``MOCOFLOW_STORE``, where it is set.

    Raises InputError for an address that cannot be opened, or not be written.
    """
    address = os.environ.get(STORE)
    if not address:
        return
    files, place = file_system(address)
    try:
        persistent(address, lambda: files.makedirs(place, exist_ok=True))
    except FileNotFoundError as error:
        raise InputError(
            f"{STORE} must be a place that can be made", f"{address} ({error})", "Choose another."
        ) from error
