"""The artifact store that a user means."""

from __future__ import annotations

from flows.allowed_folders import AllowedFolders
from flows.user_folders import cache_folder
from mocoflow_core.io.remote_store import open_store
from mocoflow_core.io.store import Store


def open_users_store(url: str | None) -> Store:
    """The store at an address, by default ``MOCOFLOW_STORE`` or the one in the user's cache."""
    address = AllowedFolders.of_environment().to_keep(url)
    return open_store(address or str(cache_folder() / "store"), cache_folder() / "mirrors")
