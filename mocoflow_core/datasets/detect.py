"""Which data set a folder is, from what lies in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mocoflow_core.datasets.kinds import KINDS, DatasetKind
from mocoflow_core.errors import InputError

_NAMED_SUBJECTS = 5


def kind_of(name: str, folder: Path) -> DatasetKind:
    """The kind of a name; of the folder or file where it is ``auto``. Raises InputError."""
    if name == "auto":
        return KINDS["video"] if folder.is_file() else detect_kind(folder)
    if name not in KINDS:
        raise InputError(
            "a kind of data set", repr(name), f"Choose one of auto, {', '.join(KINDS)}."
        )
    return KINDS[name]


def detect_kind(folder: Path, kinds: Mapping[str, DatasetKind] = KINDS) -> DatasetKind:
    """The kind whose parts the folder has.

    Raises InputError where there is none, which lists what each kind needs and what is missing,
    the nearest first; where it is several; and for a folder that holds data sets.
    """
    if not folder.is_dir():
        raise InputError("a folder of a data set", f"nothing at {folder}", "Check the path.")
    kinds = {name: kind for name, kind in kinds.items() if kind.source == "folder"}
    missing = {name: kind.missing(folder) for name, kind in kinds.items()}
    found = [kinds[name] for name, parts in missing.items() if not parts]
    if len(found) == 1:
        return found[0]
    if found:
        names = " and ".join(kind.name for kind in found)
        raise InputError(
            "a folder of one data set", f"one of {names}", "Name the kind: mocoflow import KIND."
        )
    if subjects := subjects_in(folder, kinds):
        more = ", ..." if len(subjects) > _NAMED_SUBJECTS else ""
        listed = ", ".join(subjects[:_NAMED_SUBJECTS]) + more
        raise InputError(
            "the folder of one subject",
            f"{folder} with {len(subjects)} of them ({listed})",
            f"Name one, as {folder / subjects[0]}.",
        )
    nearest = sorted(missing, key=lambda name: len(missing[name]))
    lacks = "; ".join(f"{name} lacks {', '.join(missing[name])}" for name in nearest)
    raise InputError(
        "a folder with a scene.json or of a known data set",
        f"{folder}, which is none",
        f"To be one it would need: {lacks}.",
    )


def subjects_in(folder: Path, kinds: Mapping[str, DatasetKind]) -> list[str]:
    """Names of the folders inside that are data sets of these kinds themselves."""
    return [
        inside.name
        for inside in sorted(folder.iterdir())
        if inside.is_dir() and any(not kind.missing(inside) for kind in kinds.values())
    ]
