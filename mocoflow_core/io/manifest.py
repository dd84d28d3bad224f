"""The manifest of an artifact: what it is made of, what it was made from, what it cost."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel, ConfigDict, JsonValue, ValidationError

from mocoflow_core.io.content_key import digest_file

MANIFEST = "manifest.json"
FORMAT = "mocoflow-artifact"
NAMED_LIBRARIES = ("mocoflow", "torch", "numpy", "scipy", "trimesh", "av")


class Payload(BaseModel):
    """One file of an artifact; ``path`` is relative to the artifact's folder."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: str
    size: int
    sha256: str

    def is_intact(self, folder: Path) -> bool:
        """Whether the file is there with its size and its digest."""
        file = folder / self.path
        return file.is_file() and file.stat().st_size == self.size and self._matches(file)

    def _matches(self, file: Path) -> bool:
        return digest_file(file) == self.sha256


class Manifest(BaseModel):
    """Everything about an artifact except its payload's bytes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: str = FORMAT
    stage: str
    key: str
    algorithm_version: int
    inputs: dict[str, str]
    configuration: dict[str, JsonValue]
    payloads: tuple[Payload, ...]
    wall_s: float
    cpu_s: float
    versions: dict[str, str]
    summary: dict[str, JsonValue]

    @classmethod
    def read(cls, folder: Path) -> Manifest | None:
        """The manifest in a folder; ``None`` where there is none or it is damaged."""
        try:
            return cls.model_validate_json((folder / MANIFEST).read_bytes())
        except (OSError, ValidationError):
            return None

    def write(self, folder: Path) -> None:
        (folder / MANIFEST).write_text(self.model_dump_json(indent=1) + "\n")

    def is_intact(self, folder: Path) -> bool:
        return all(payload.is_intact(folder) for payload in self.payloads)


def describe_payloads(folder: Path) -> tuple[Payload, ...]:
    """Size and digest of every file below a folder, the manifest excepted."""
    return tuple(
        Payload(
            path=path.relative_to(folder).as_posix(),
            size=path.stat().st_size,
            sha256=digest_file(path),
        )
        for path in _files(folder)
    )


def _files(folder: Path) -> Iterator[Path]:
    return (p for p in sorted(folder.rglob("*")) if p.is_file() and p.name != MANIFEST)


def flush_to_disk(folder: Path) -> None:
    """Force every file and folder below onto the disk, so that a rename can commit them."""
    for path in [*folder.rglob("*"), folder]:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def library_versions() -> dict[str, str]:
    """Versions of the libraries whose changes may change numbers."""
    return {name: importlib.metadata.version(name) for name in NAMED_LIBRARIES}
