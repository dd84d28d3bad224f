"""The artifact store that a user means."""

from __future__ import annotations

from flows.user_folders import cache_folder
from mocoflow_core.io.remote_store import open_store
from mocoflow_core.io.store import Store


def open_users_store(url: str | None) -> Store:
    """The store at an address, or the one in the user's cache."""
    return open_store(url or str(cache_folder() / "store"), cache_folder() / "mirrors")
