"""An estimate as it lies on the disk: a file of any container, or a folder of files."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mocoflow_core.body.mesh_file import MESH_SUFFIXES
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_untrusted

FOLDER_SUFFIXES = (".npy", ".npz", ".json", *MESH_SUFFIXES)
# Where TRAM keeps its tracks.
SUBFOLDERS = ("hps",)
_LAST_NUMBER = re.compile(r"(\d+)\D*$")
_SHOWN = 12
HIGHEST = 2**31 - 1


@dataclass(frozen=True, eq=False)
class EstimateFile:
    """The path of an estimate. Its content is read once, and never runs anything."""

    path: Path

    @property
    def is_folder(self) -> bool:
        return self.path.is_dir()

    @cached_property
    def content(self) -> object:
        """What a file holds: dicts, lists, arrays, numbers. Nothing for a folder.

        Raises InputError for what cannot be read.
        """
        return None if self.is_folder else read_stored(self.path)

    def files(self, *suffixes: str, below: str = "") -> list[Path]:
        """The files of a folder with one of these endings, sorted by name."""
        folder = self.path / below
        inside = [file for file in estimate_files(self.path) if file.parent == folder]
        return [file for file in inside if file.suffix.lower() in suffixes]


def read_stored(path: Path) -> object:
    """The content of one file. Raises InputError for what cannot be read."""
    if path.suffix.lower() == ".json":
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError) as error:
            raise InputError(
                f"JSON in {path.name}", "something else", "Export the file again."
            ) from error
    return read_untrusted(path)


def estimate_files(path: Path) -> list[Path]:
    """Every file that a reader of this file or folder may open.

    Raises InputError for links that lead out of the folder.
    """
    if not path.is_dir():
        return [path]
    folders = [path, *(path / name for name in SUBFOLDERS if (path / name).is_dir())]
    found = sorted(file for folder in folders for file in folder.iterdir() if _is_wanted(file))
    root = path.resolve()
    for file in found:
        if not file.resolve().is_relative_to(root):
            raise InputError(
                f"files inside {path.name}",
                f"{file.name}, a link to somewhere else",
                "Copy the file into the folder.",
            )
    return found


def _is_wanted(file: Path) -> bool:
    return file.suffix.lower() in FOLDER_SUFFIXES and file.is_file()


def frame_numbers(names: Iterable[str]) -> list[int]:
    """The last number in each name.

    Raises InputError for a name without one, for one that comes twice, and for one that is no
    frame's.
    """
    numbers: dict[int, str] = {}
    for name in names:
        found = _LAST_NUMBER.search(Path(name).stem)
        number = int(found.group(1)) if found else None
        if number is None or number in numbers or number > HIGHEST:
            raise InputError(
                "files named by the numbers of their frames, each once, as in 000012.obj",
                name if number is None or number > HIGHEST else f"{numbers[number]} and {name}",
                "Rename or remove the file.",
            )
        numbers[number] = name
    return list(numbers)


def people_of(content: object) -> dict[int, Mapping[str, object]]:
    """Records by the id of their person; empty for what is no such dictionary.

    Ids are integers of any kind, numpy's among them.
    """
    if not isinstance(content, Mapping) or not content:
        return {}
    people = {}
    for person, record in content.items():
        if isinstance(person, str) or not hasattr(person, "__index__"):
            return {}
        if not isinstance(record, Mapping):
            return {}
        people[int(person)] = record
    return people


def what_is_in(stored: EstimateFile) -> str:
    """A line for people: names of keys or files, the first few."""
    if stored.is_folder:
        names = [file.name for file in sorted(stored.path.iterdir())]
        return f"a folder with {_shortened(names)}" if names else "an empty folder"
    content = stored.content
    people = people_of(content)
    if people:
        return f"records of {len(people)} people with {_shortened(people[min(people)])}"
    if isinstance(content, Mapping):
        first = next(iter(content.values()), None)
        inner = f", the first one with {_shortened(first)}" if isinstance(first, Mapping) else ""
        return f"a dictionary with {_shortened(content)}{inner}"
    if isinstance(content, list):
        return f"a list of {len(content)}"
    return f"a {type(content).__name__}"


def _shortened(names: Iterable[object]) -> str:
    listed = [str(name) for name in names]
    more = f" and {len(listed) - _SHOWN} more" if len(listed) > _SHOWN else ""
    return ", ".join(listed[:_SHOWN]) + more
