"""Locks between processes of one machine: the kernel drops them when their holder dies."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


@contextmanager
def holding(path: Path, *, wait: bool = True) -> Iterator[bool]:
    """Hold a lock for the block, whose value says so.

    Without ``wait`` it is ``False`` where another process holds the lock. The holder may remove
    the file: who has waited for it then takes the lock of that name anew.
    """
    how = fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        with path.open("w") as file:
            try:
                fcntl.flock(file, how)
            except BlockingIOError:
                yield False
                return
            if _is_named(file, path):
                yield True
                return


def is_held(path: Path) -> bool:
    """Whether a process holds a lock right now; the folder may be one that is only read."""
    try:
        with path.open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _is_named(file: IO[str], path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False
