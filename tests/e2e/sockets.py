"""Where a process and all that it has started listen."""

from __future__ import annotations

from contextlib import suppress
from ipaddress import ip_address

import psutil


def listening(pid: int) -> set[str]:
    """Addresses, without ports."""
    found: set[str] = set()
    with suppress(psutil.NoSuchProcess):
        first = psutil.Process(pid)
        for process in (first, *first.children(recursive=True)):
            with suppress(psutil.NoSuchProcess):
                sockets = process.net_connections("inet")
                found |= {s.laddr.ip for s in sockets if s.status == psutil.CONN_LISTEN}
    return found


def beyond_loopback(addresses: set[str]) -> set[str]:
    return {address for address in addresses if not ip_address(address).is_loopback}
