"""Which of a user's body model files is meant: told by the names they are distributed under."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from mocoflow_core.body.smpl_file import Family

Gender = Literal["female", "male", "neutral"]

# SMPL_FEMALE.pkl, basicModel_f_lbs_10_207_0_v1.0.0.pkl and their relatives, without their ending.
_NAMES: dict[tuple[Family, Gender], re.Pattern[str]] = {
    ("SMPL", "female"): re.compile(r"smpl_female|basic_?model_f(emale)?_", re.IGNORECASE),
    ("SMPL", "male"): re.compile(r"smpl_male|basic_?model_m(ale)?_", re.IGNORECASE),
    ("SMPL", "neutral"): re.compile(r"smpl_neutral|basic_?model_neutral_", re.IGNORECASE),
    ("SMPL-X", "female"): re.compile(r"smplx_female", re.IGNORECASE),
    ("SMPL-X", "male"): re.compile(r"smplx_male", re.IGNORECASE),
    ("SMPL-X", "neutral"): re.compile(r"smplx_neutral", re.IGNORECASE),
}
_ENDINGS = (".pkl", ".npz")
# Data sets and tools work with version 1.0; later ones have other shapes for the same numbers.
_FIRST_VERSION = "v1.0"


def models_in(folder: Path, family: Family, gender: Gender) -> list[Path]:
    """The files of a model in a folder or below it, the likeliest first."""
    return sorted(
        (
            path
            for path in folder.rglob("*")
            if path.suffix.lower() in _ENDINGS and _NAMES[family, gender].match(path.stem)
        ),
        key=lambda path: (_FIRST_VERSION not in path.name, len(path.parts), path.name),
    )


def genders_of(file: Path) -> list[Gender]:
    """The genders that a file of SMPL may be of by its name: one or none."""
    return [gender for (_, gender), pattern in _NAMES.items() if pattern.match(file.stem)]
