"""A full disk is the user's to solve: one clear line instead of a library's traceback."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager

from mocoflow_core.errors import InputError


@contextmanager
def full_disk_is_bad_input(place: str) -> Iterator[None]:
    """Turn any failure that comes from a full disk into an InputError that names the place."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if not says_disk_full(error):
            raise
        raise InputError(
            f"{place} needs free space",
            "a full disk",
            "Free some or choose another folder; finished stages are kept.",
        ) from error


def says_disk_full(error: BaseException | None) -> bool:
    """Libraries wrap the system's error: look along the chain, and at their words."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        if os.strerror(errno.ENOSPC) in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False
