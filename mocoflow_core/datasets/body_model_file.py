"""Which of a user's SMPL model files a data set needs."""

from __future__ import annotations

from pathlib import Path

from mocoflow_core.body.model_folder import Gender, genders_of, models_in
from mocoflow_core.body.smpl_file import where_to_get
from mocoflow_core.errors import InputError


def find_body_model(given: Path | None, gender: Gender, purpose: str) -> tuple[Path, str | None]:
    """The SMPL file of a gender: the given file itself, or the one of that name in a folder.

    Returns the file, and a remark where the choice is doubtful.

    Raises InputError where nothing is given or found; says which file is needed and where users
    get it. ``purpose`` says what for.
    """
    required = f"the {gender} SMPL model to {purpose}"
    if given is None:
        raise InputError(required, "none", where_to_get())
    if given.is_file():
        return given, _doubt(given, gender)
    if not given.is_dir():
        raise InputError(required, f"nothing at {given}", where_to_get())
    found = models_in(given, "SMPL", gender)
    if not found:
        raise InputError(required, f"a folder without it, {given}", where_to_get())
    others = ", ".join(path.name for path in found[1:])
    return found[0], f"of several models {found[0].name} is taken, not {others}" if others else None


def _doubt(file: Path, gender: Gender) -> str | None:
    """A remark where a file's name says another gender."""
    said = genders_of(file)
    if not said or gender in said:
        return None
    return f"the body model {file.name} is {said[0]} by its name; the data set needs {gender}"
