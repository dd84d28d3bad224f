"""Keys made of content: the same inputs give the same key, wherever and whenever they lie."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

KEY_LENGTH = 40


def key_of(
    stage: str,
    algorithm_version: int,
    inputs: Mapping[str, str],
    configuration: Mapping[str, Any],
) -> str:
    """Key of what a stage computes: hexadecimal, the name of its folder.

    ``inputs`` are keys of artifacts and digests of source files; ``configuration`` holds exactly
    the fields that the stage reads.
    """
    document = {
        "stage": stage,
        "algorithm_version": algorithm_version,
        "inputs": dict(inputs),
        "configuration": canonical(configuration),
    }
    return digest_document(document)[:KEY_LENGTH]


def digest_document(document: object) -> str:
    """SHA-256 of a JSON document, independent of the order of its fields."""
    text = json.dumps(canonical(document), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def canonical(value: object) -> object:
    """Plain JSON values with every float in hexadecimal, so that no rounding hides a change.

    Raises ``TypeError`` for anything else: a path or a tensor has no place in a key.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return {"float": value.hex()}
    if isinstance(value, Mapping):
        return {str(name): canonical(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(item) for item in value]
    raise TypeError(f"A {type(value).__name__} cannot be part of a content key")


def digest_file(path: Path) -> str:
    """SHA-256 of a file's bytes; read once in a process while the file stays untouched."""
    status = path.stat()
    return _digest_unchanged(path.resolve(), status.st_size, status.st_mtime_ns, status.st_ino)


@lru_cache(maxsize=65536)
def _digest_unchanged(path: Path, size: int, modified_ns: int, inode: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest_files(files: Mapping[str, Path]) -> str:
    """One digest for named files; names count, folders they lie in do not."""
    return digest_document({name: digest_file(path) for name, path in files.items()})
