"""Files of a data set's folder that the data set itself names."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from mocoflow_core.errors import InputError


def file_inside(folder: Path, name: str) -> Path:
    """The regular file ``name``, relative to ``folder`` and within it.

    The folder itself may be reached through links; what lies in it may not lead out of it.

    Raises:
        InputError: the name is absolute or climbs, a link leads outside, or no file is there.
    """
    written = PurePosixPath(name.replace("\\", "/"))
    if written.is_absolute() or ".." in written.parts or ":" in name or "\0" in name:
        raise InputError(
            f"files of {folder} must be named relative to it",
            f"{name[:120]!r}",
            "Get the data set from its maker again.",
        )
    path = folder / written
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(
            f"{path} must lie in its folder",
            f"a link to {path.resolve()}",
            "Copy the file into the folder, or give the folder that it lies in.",
        )
    if not path.is_file():
        raise InputError(f"{path} must be a file", "none", "Complete the data set.")
    return path
