"""A file that appears complete or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Where to write the file: beside its name, which it takes once the block is done.

    The ending stays, as libraries tell formats by it. After a failure nothing new is left, and an
    earlier file of that name is as it was.
    """
    beside = path.with_name(f".new.{path.name}")
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
