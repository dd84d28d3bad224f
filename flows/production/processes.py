"""Processes that outlive the command that has started them, found again by their pid files."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from flows.production.site import MARK, Site


def start(
    site: Site, name: str, command: Sequence[str], environment: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    """Start a process of the site in a session of its own, its output in the site's logs."""
    heed_interrupts()
    with (site.logs / f"{name}.log").open("ab") as log:
        process = subprocess.Popen(
            command,
            cwd=site.folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    site.pid_file(name).write_text(f"{process.pid} {_started_at(process.pid)}\n")
    return process


def heed_interrupts() -> None:
    """Let processes that are started from now on end at an interrupt.

    Whoever was started with ``&`` by a script ignores interrupts, and so does what they start: a
    worker, which Prefect ends by interrupting it, would not.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def is_running(site: Site, name: str) -> bool:
    return _pid_of(site, name) is not None


def stop(site: Site, name: str, grace_s: float = 20.0) -> bool:
    """End a process with its group; tell whether there was one."""
    pid = _pid_of(site, name)
    if pid is not None:
        _signal_group(pid, signal.SIGTERM)
        if not _gone(pid, grace_s):
            _signal_group(pid, signal.SIGKILL)
            _gone(pid, grace_s)
    site.pid_file(name).unlink(missing_ok=True)
    return pid is not None


def end_what_is_left(site: Site, grace_s: float = 10.0) -> list[int]:
    """End what the site's processes have started and left behind; give their ids.

    Only where the system shows the environment of processes (``/proc``).
    """
    left = list(_marked(site))
    for sent in (signal.SIGTERM, signal.SIGKILL):
        for pid in _marked(site):
            with suppress(ProcessLookupError):
                os.kill(pid, sent)
        end = time.monotonic() + grace_s
        while any(_marked(site)) and time.monotonic() < end:
            time.sleep(0.1)
    return left


def _pid_of(site: Site, name: str) -> int | None:
    """The id in the pid file, unless that process is gone and the id another one's."""
    try:
        pid, _, started = site.pid_file(name).read_text().strip().partition(" ")
    except OSError:
        return None
    return int(pid) if started and started == _started_at(int(pid)) else None


def _started_at(pid: int) -> str:
    """When a process was started, as ps writes it; nothing for one that is gone.

    In UTC and English, whatever the user's terminal says.
    """
    words = ["ps", "-o", "stat=,lstart=", "-p", str(pid)]
    everywhere = os.environ | {"TZ": "UTC", "LC_ALL": "C"}
    said = subprocess.run(words, capture_output=True, text=True, env=everywhere).stdout
    state, _, when = said.partition(" ")
    return "" if state.startswith("Z") else " ".join(when.split())


def _gone(pid: int, within_s: float) -> bool:
    end = time.monotonic() + within_s
    while _started_at(pid):
        if time.monotonic() > end:
            return False
        time.sleep(0.1)
    return True


def _signal_group(pid: int, sent: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.killpg(pid, sent)


def _marked(site: Site) -> Iterator[int]:
    mark = f"{MARK}={site.folder}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            marked = mark in (process / "environ").read_bytes().split(b"\0")
            if marked and int(process.name) != os.getpid():
                yield int(process.name)
