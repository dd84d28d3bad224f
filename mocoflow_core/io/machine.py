"""What a run ran on; times mean nothing without it. And which machine this is."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from uuid import uuid4

from pydantic import JsonValue

from mocoflow_core.io.content_key import digest_document
from mocoflow_core.io.locks import holding
from mocoflow_core.io.whole_file import whole_file

# Missing in many containers, and in others that of their image.
_SYSTEMS_OWN = Path("/etc/machine-id")


def describe_machine() -> dict[str, JsonValue]:
    """Cores this process may use, the processor's model, and the load at this moment."""
    return {
        "cores": _usable_cores(),
        "model": _processor(),
        "load": round(os.getloadavg()[0], 2),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
    }


def described(machine: Mapping[str, JsonValue], names: Sequence[str]) -> str:
    """Some facts of a machine in words: ``model AMD EPYC, cores 2``."""
    return ", ".join(f"{name} {machine[name]}" for name in names if name in machine)


def machine_id(file: Path) -> str:
    """What tells this machine from others, as names do not: containers change theirs.

    A part is made once and kept in the file, of the user's state; the system's own id tells apart
    machines that share the user's folders. Where the file cannot be written, the id is nobody's.
    """
    try:
        kept = _made_once(file)
    except OSError:
        kept = uuid4().hex
    systems = _SYSTEMS_OWN.read_text() if _SYSTEMS_OWN.is_file() else ""
    return digest_document([kept, systems.strip()])[:16]


def _made_once(file: Path) -> str:
    with holding(file.with_name(f"{file.name}.lock")):
        held = file.read_text().strip() if file.exists() else ""
        if held:
            return held
        made = uuid4().hex
        with whole_file(file) as beside:
            beside.write_text(f"{made}\n")
        return made


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
