"""Which of a user's SMPL model files a data set needs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from mocoflow_core.errors import InputError

Gender = Literal["female", "male", "neutral"]

# SMPL_FEMALE.pkl, basicModel_f_lbs_10_207_0_v1.0.0.pkl and their relatives, without their ending.
_NAMES: dict[Gender, re.Pattern[str]] = {
    "female": re.compile(r"smpl_female|basic_?model_f(emale)?_", re.IGNORECASE),
    "male": re.compile(r"smpl_male|basic_?model_m(ale)?_", re.IGNORECASE),
    "neutral": re.compile(r"smpl_neutral|basic_?model_neutral_", re.IGNORECASE),
}
_ENDINGS = (".pkl", ".npz")
# Data sets were made with version 1.0; later versions have other shapes for the same numbers.
_FIRST_VERSION = "v1.0"
WHERE_TO_GET_IT = (
    "Get SMPL at smpl.is.tue.mpg.de (female and male) or smplify.is.tue.mpg.de (neutral) under "
    "its own licence, and give the file, or the folder that holds it, with --body-model."
)


def find_body_model(given: Path | None, gender: Gender, purpose: str) -> tuple[Path, str | None]:
    """The SMPL file of a gender: the given file itself, or the one of that name in a folder.

    Returns the file, and a remark where the choice is doubtful.

    Raises InputError where nothing is given or found; says which file is needed and where users
    get it. ``purpose`` says what for.
    """
    required = f"the {gender} SMPL model to {purpose}"
    if given is None:
        raise InputError(required, "none", WHERE_TO_GET_IT)
    if given.is_file():
        return given, _doubt(given, gender)
    if not given.is_dir():
        raise InputError(required, f"nothing at {given}", WHERE_TO_GET_IT)
    found = sorted(
        (
            path
            for path in given.rglob("*")
            if path.suffix.lower() in _ENDINGS and _NAMES[gender].match(path.stem)
        ),
        key=lambda path: (_FIRST_VERSION not in path.name, len(path.parts), path.name),
    )
    if not found:
        raise InputError(required, f"a folder without it, {given}", WHERE_TO_GET_IT)
    others = ", ".join(path.name for path in found[1:])
    return found[0], f"of several models {found[0].name} is taken, not {others}" if others else None


def _doubt(file: Path, gender: Gender) -> str | None:
    """A remark where a file's name says another gender."""
    said = [other for other, pattern in _NAMES.items() if pattern.match(file.stem)]
    if not said or gender in said:
        return None
    return f"the body model {file.name} is {said[0]} by its name; the data set needs {gender}"
