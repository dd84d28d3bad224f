"""Slots of a machine, such as its GPUs, as a global concurrency limit of the Prefect server.

Cells of benchmarks and runs of one scene that name the same limit share its slots.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from prefect.client.orchestration import get_client
from prefect.concurrency.sync import concurrency
from prefect.exceptions import ObjectNotFound

from mocoflow_core.errors import InputError

# How long the slot of a killed process stays taken.
_LEASE_S = 60.0


def require_slots(name: str) -> None:
    """Raise InputError where the server has no limit of that name, or none that lets one in."""
    try:
        limit = get_client(sync_client=True).read_global_concurrency_limit_by_name(name)
    except ObjectNotFound:
        limit = None
    if limit is None or limit.limit < 1 or not limit.active:
        raise InputError(
            "--slots must be a global concurrency limit of the Prefect server",
            repr(name),
            f"prefect gcl create {name} --limit 2",
        )


@contextmanager
def held_slot(name: str | None) -> Iterator[None]:
    """Wait for a slot and hold it; without a name there is nothing to wait for."""
    if name is None:
        yield
        return
    # A server that is away for a moment does not end the work.
    with concurrency(
        name, strict=True, lease_duration=_LEASE_S, raise_on_lease_renewal_failure=False
    ):
        yield
