"""The bucket or folder of the workers' store, made before the first run."""

from __future__ import annotations

import os

from flows.allowed_folders import STORE


def make_store() -> str | None:
    """Make the place of ``MOCOFLOW_STORE``, where it is set; give its address."""
    address = os.environ.get(STORE)
    if address:
        from fsspec.core import url_to_fs

        files, place = url_to_fs(address)
        files.makedirs(place, exist_ok=True)
    return address or None
