"""Questions to a store over a network: asked again after a while, answered or clearly given up."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import says_disk_full

Answer = TypeVar("Answer")

WAITS_S = (1.0, 2.0, 4.0, 8.0)  # Beside what the libraries themselves try, about as long.
REFUSALS = (PermissionError, FileExistsError, IsADirectoryError, NotADirectoryError)


def persistent(store: str, ask: Callable[[], Answer]) -> Answer:
    """The answer of a store that may be out of reach for some seconds.

    Raises FileNotFoundError at once, as an answer; InputError at once where the store refuses, or
    when its last failure is one too many.
    """
    for wait_s in WAITS_S:
        try:
            return ask()
        except FileNotFoundError:
            raise
        except REFUSALS as error:
            raise _out_of_reach(store, error) from error
        except Exception as error:
            if not _may_pass(error):
                raise
            time.sleep(wait_s)
    try:
        return ask()
    except Exception as error:
        if isinstance(error, FileNotFoundError) or not _may_pass(error):
            raise
        raise _out_of_reach(store, error) from error


def _may_pass(error: Exception) -> bool:
    """Errors of the system and of the libraries that speak to stores; others are mistakes here."""
    if says_disk_full(error):
        return False
    return isinstance(error, OSError) or type(error).__module__ != "builtins"


def _out_of_reach(store: str, error: Exception) -> InputError:
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return InputError(
        f"The store {store} must be reachable and let itself be written",
        said,
        "Check the network, the address and the credentials; finished stages are kept on this "
        "machine, and the same command goes on from them.",
    )
