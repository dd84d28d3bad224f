"""Every way in which a strange file can fail becomes one clear error that names the file."""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mocoflow_core.errors import InputError

FETCH_AGAIN = "Copy or download the file again."

# What parsers of damaged bytes raise: ours, and those of the standard library.
_DAMAGE = (
    ArithmeticError,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    lzma.LZMAError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


def damaged(found: str) -> InputError:
    """The error for bytes that no writer leaves behind."""
    return InputError("it must be a complete, undamaged file", found, FETCH_AGAIN)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Raise what goes wrong inside as an InputError about ``path``."""
    try:
        yield
    except InputError as error:
        required = error.required.removeprefix("it ")
        raise InputError(f"{path} {required}", error.got, error.action) from error
    except PermissionError as error:
        raise InputError(f"{path} must be readable", str(error), "Give yourself access.") from error
    except MemoryError as error:
        raise InputError(
            f"{path} must fit into memory", "a file that does not", "Free memory or cut the file."
        ) from error
    except _DAMAGE as error:
        found = f"{type(error).__name__}: {str(error)[:200]}"
        raise InputError(
            f"{path} must be a complete, undamaged file", found, FETCH_AGAIN
        ) from error


def require_file(path: Path) -> Path:
    """The path itself; InputError unless a regular file lies there."""
    if not path.is_file():
        found = "a folder" if path.is_dir() else "none" if not path.exists() else "a device"
        raise InputError(f"{path} must be a file", found, "Check the path.")
    return path
