"""Processes that end with the one that started them, and what they say."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
from collections import deque
from collections.abc import Callable, Mapping, Sequence

_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG
_TAIL = 30  # lines that an error repeats
_PATIENCE_S = 40.0  # torch's launcher waits 30 s for its workers before it kills them


class ProcessFailed(RuntimeError):
    """A process ended with an exit code other than 0; the message is the end of its output."""


def die_with_parent(how: signal.Signals) -> None:
    """Ask the kernel for a signal when the process that started this one ends; Linux only."""
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_DEATH_SIGNAL, how)


def run_logged(
    command: Sequence[str], hear: Callable[[str], None], environment: Mapping[str, str]
) -> None:
    """Run a command to its end and hand over each line of its output as it comes.

    It stays in this process's group, so that a signal to the group reaches it too; whatever else
    interrupts the waiting ends it.

    Args:
        environment: variables that are added to those of this process.

    Raises ProcessFailed.
    """
    tail: deque[str] = deque(maxlen=_TAIL)
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
        errors="replace",
        env={**os.environ, **environment},
    ) as process:
        try:
            for line in process.stdout or ():
                tail.append(line.rstrip())
                hear(line.rstrip())
            code = process.wait()
        except BaseException:
            _end(process)
            raise
    if code:
        raise ProcessFailed("\n".join(tail))


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.wait(_PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
