"""Networks of the user's own, named by a path and known by their content."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import PlainSerializer, PlainValidator

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file


@dataclass(frozen=True, eq=False)
class FileOfNetwork:
    """Where it lies now. Nothing is looked at before it is asked for: who may be told of a file is
    decided between the two.
    """

    path: Path
    recorded: str | None = None  # the digest that a record gives, which leaves folders out

    @cached_property
    def digest(self) -> str:
        """The sha256 of its bytes. Raises InputError where no file is."""
        if self.recorded is not None:
            return self.recorded
        self.require()
        return digest_file(self.path)

    def require(self) -> None:
        """Raise InputError where no file is."""
        if not self.path.is_file():
            raise InputError("a file of a network", f"nothing at {self.path}", "Check the path.")

    def __eq__(self, other: object) -> bool:
        """By place and content."""
        if not isinstance(other, FileOfNetwork):
            return NotImplemented
        return self.path == other.path and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.path)


def _named(value: object) -> FileOfNetwork:
    """A path as it is written in settings; a record, where folders are left out, names the file."""
    if isinstance(value, FileOfNetwork):
        return value
    if isinstance(value, str | Path):
        return FileOfNetwork(_from_home(Path(value)))
    if isinstance(value, dict) and value.keys() == {"name", "digest"}:
        name = Path(str(value["name"]))
        if name.name == str(name):
            return FileOfNetwork(name, str(value["digest"]))
    raise ValueError("a path, or a record's name and digest")


def _from_home(path: Path) -> Path:
    """With ``~`` written out; the homes of others are nobody's business."""
    return Path.home().joinpath(*path.parts[1:]) if path.parts[:1] == ("~",) else path


def _recorded(file: FileOfNetwork) -> dict[str, str]:
    return {"name": file.path.name, "digest": file.digest}


# A field of a configuration: set by a path, recorded and counted by name and content.
NetworkFile = Annotated[
    FileOfNetwork, PlainValidator(_named), PlainSerializer(_recorded, when_used="json")
]
