"""The recordings of a configured data set, each a scene of a benchmark."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from flows.data_set_roots import ROOTS, root_of
from mocoflow_core.errors import InputError


class Recording(NamedTuple):
    """One subject of People-Snapshot or ZJU-MoCap, or one sequence of AIST."""

    name: str
    folder: Path
    import_settings: tuple[str, ...] = ()


def is_data_set(word: str) -> bool:
    """Whether a word names a data set, or one recording of it as ``aist:NAME``."""
    return word.partition(":")[0] in ROOTS


def recordings(word: str) -> tuple[Recording, ...]:
    """All that lie below a data set's root, by name, or the one that the word names.

    Raises InputError where the root is not configured, and where it holds nothing of the kind.
    """
    data_set, _, wanted = word.partition(":")
    root = root_of(data_set)
    found = sorted((_sequences if data_set == "aist" else _subjects)(data_set, root))
    chosen = tuple(one for one in found if wanted in ("", one.name))
    if not chosen:
        names = ", ".join(one.name for one in found[:5]) or "none"
        raise InputError(
            f"a recording of {data_set} in {root}",
            f"{wanted or 'none'}; there are {names}",
            "docs/datasets says what lies where.",
        )
    return chosen


def _subjects(data_set: str, root: Path) -> Iterator[Recording]:
    from mocoflow_core.datasets.detect import subjects_in
    from mocoflow_core.datasets.kinds import KINDS

    for name in subjects_in(root, {data_set: KINDS[data_set]}):
        yield Recording(name, root / name)


def _sequences(_: str, root: Path) -> Iterator[Recording]:
    from mocoflow_core.datasets.aist_files import find_videos, sequences_in

    for name in sequences_in(find_videos(root)):
        yield Recording(name, root, (f"sequence={name}",))
