"""Other machines that a worker lets its runs speak to: whoever answers there runs code here."""

from __future__ import annotations

import os

from flows.allowed_folders import AllowedFolders
from mocoflow_core.errors import InputError

CLUSTER_ADDRESSES = "MOCOFLOW_CLUSTER_ADDRESSES"


def require_allowed_address(address: str, parameter: str) -> None:
    """Raise InputError for an address that the worker was not told, to the letter.

    On a command line, where neither folders nor addresses are told, any address will do.
    """
    told = os.environ.get(CLUSTER_ADDRESSES, "").split(",")
    allowed = list(filter(None, (word.strip() for word in told)))
    if address in allowed or not (allowed or AllowedFolders.of_environment().confine):
        return
    raise InputError(
        f"{parameter} must be an address that the worker was told ({CLUSTER_ADDRESSES}: "
        f"{', '.join(allowed) or 'none'})",
        repr(address),
        f"Leave it out, or set {CLUSTER_ADDRESSES} of the worker.",
    )
