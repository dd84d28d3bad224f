"""Networks of the user's own, named by a path and known by their content."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, PlainSerializer

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file


@dataclass(frozen=True)
class FileOfNetwork:
    """Where it lies now, and the sha256 of its bytes."""

    path: Path
    digest: str

    @classmethod
    def of(cls, path: Path) -> FileOfNetwork:
        """Raises InputError where no file is."""
        if not path.is_file():
            raise InputError("a file of a network", f"nothing at {path}", "Check the path.")
        return cls(path, digest_file(path))


def _opened(value: object) -> object:
    """A path as it is written in settings; a record, where folders are left out, names the file."""
    if isinstance(value, str | Path):
        return FileOfNetwork.of(Path(value).expanduser())
    if isinstance(value, dict) and "name" in value:
        return FileOfNetwork(Path(str(value["name"])), str(value.get("digest")))
    return value


def _recorded(file: FileOfNetwork) -> dict[str, str]:
    return {"name": file.path.name, "digest": file.digest}


# A field of a configuration: set by a path, recorded and counted by name and content.
NetworkFile = Annotated[
    FileOfNetwork, BeforeValidator(_opened), PlainSerializer(_recorded, when_used="json")
]
