"""What a run ran on; times mean nothing without it."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from pydantic import JsonValue


def describe_machine() -> dict[str, JsonValue]:
    """Cores this process may use, the processor's model, and the load at this moment."""
    return {
        "cores": _usable_cores(),
        "model": _processor(),
        "load": round(os.getloadavg()[0], 2),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
    }


def _usable_cores() -> int:
    """Only some systems can confine a process to a part of their cores."""
    confined = getattr(os, "sched_getaffinity", None)
    return len(confined(0)) if confined else os.cpu_count() or 1


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    for line in information.read_text().splitlines() if information.exists() else ():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()
