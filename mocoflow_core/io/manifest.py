"""The manifest of an artifact: what it is made of, what it was made from, what it cost."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError, field_validator

from mocoflow_core.io.content_key import digest_file

MANIFEST = "manifest.json"
FORMAT = "mocoflow-artifact"
NO_MANIFEST = f"{MANIFEST} is missing or cannot be read"
OTHER_MANIFEST = f"{MANIFEST} is that of another artifact"
NAMED_LIBRARIES = ("mocoflow", "torch", "numpy", "scipy", "trimesh", "av")


class Payload(BaseModel):
    """One file of an artifact; ``path`` is relative to the artifact's folder."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: str
    size: int
    sha256: str = Field(pattern="^[0-9a-f]{64}$")

    @field_validator("path")
    @classmethod
    def _stays_inside(cls, path: str) -> str:
        """Manifests come from shared stores: none may name a file outside of its folder."""
        if PurePosixPath(path).is_absolute() or ".." in PurePosixPath(path).parts:
            raise ValueError(f"{path!r} leads out of the artifact's folder")
        return path

    def fault(self, folder: Path, *, thorough: bool = True) -> str | None:
        """What is wrong with the file, in words; ``None`` where size and digest are right.

        Without ``thorough`` the size alone is looked at.
        """
        file = folder / self.path
        if not file.is_file():
            return f"{self.path} is missing"
        if (size := file.stat().st_size) != self.size:
            return f"{self.path} has {size} bytes instead of {self.size}"
        if thorough and digest_file(file) != self.sha256:
            return f"{self.path} has changed since it was written"
        return None


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
            return cls.parse((folder / MANIFEST).read_bytes())
        except OSError:
            return None

    @classmethod
    def parse(cls, content: bytes | None) -> Manifest | None:
        """A manifest from its file's content; ``None`` where there is none or it is damaged."""
        try:
            return None if content is None else cls.model_validate_json(content)
        except ValidationError:
            return None

    def write(self, folder: Path) -> None:
        (folder / MANIFEST).write_text(self.model_dump_json(indent=1) + "\n")

    def is_of(self, stage: str, key: str) -> bool:
        return (self.stage, self.key) == (stage, key)


def fault_of(folder: Path, *, thorough: bool = True) -> str | None:
    """What is wrong with the artifact in ``<stage>/<key>/``, in words; ``None`` where nothing is.

    Without ``thorough`` sizes are looked at, not digests.
    """
    manifest = Manifest.read(folder)
    if manifest is None:
        return NO_MANIFEST
    if not manifest.is_of(folder.parent.name, folder.name):
        return OTHER_MANIFEST
    faults = (payload.fault(folder, thorough=thorough) for payload in manifest.payloads)
    return next(filter(None, faults), None)


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
