"""Links in a data set's folder: a stranger's may lead to files that are none of the data set's."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal

from mocoflow_core.errors import InputError

Links = Literal["inside", "followed"]
LINKS = "Inside: links that lead out of the data set's folder are refused; followed: they are used."


def require_inside(folder: Path, paths: Iterable[Path], links: Links) -> None:
    """Raise InputError for a path below ``folder`` that leads out of it.

    The folder itself may be reached through links.
    """
    if links == "followed":
        return
    root = folder.resolve()
    for path in paths:
        leads_to = Path(os.path.realpath(path))
        if not leads_to.is_relative_to(root):
            raise InputError(
                f"files that lie in {folder}",
                f"{path.relative_to(folder)}, which leads to {leads_to}",
                "Copy the file there, or allow your own links with the field links=followed.",
            )


def links_below(folder: Path) -> Iterator[Path]:
    """Every link in a folder's tree, to files and folders alike; none is followed."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink():
                yield Path(entry.path)
            elif entry.is_dir(follow_symlinks=False):
                yield from links_below(Path(entry.path))
