"""All areas and their cases. A new area is one file with its ``CASES`` and its name here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mocoflow_core.errors import InputError
from mocoflow_core.stability import (
    broken_recordings,
    compositing,
    encoding,
    location_search,
    mesh,
    motion_consensus,
    optimisation,
    planted_faults,
    precision,
    rays_and_boxes,
    scale,
    se3,
)
from mocoflow_core.stability.case import Case

MODULES = (
    se3,
    encoding,
    compositing,
    rays_and_boxes,
    motion_consensus,
    mesh,
    location_search,
    optimisation,
    planted_faults,
    broken_recordings,
    scale,
    precision,
)
AREAS: dict[str, tuple[Case[Any], ...]] = {
    module.__name__.rpartition(".")[2]: module.CASES for module in MODULES
}


def about(area: str) -> str:
    """What an area is about: the first line of its file."""
    documents = dict(zip(AREAS, (module.__doc__ for module in MODULES), strict=True))
    return (documents[area] or "").splitlines()[0]


def require_areas(names: Sequence[str]) -> tuple[str, ...]:
    """The named areas, or all of them where none is named. Raises InputError for an unknown one."""
    for name in names:
        if name not in AREAS:
            raise InputError(
                f"--area must be one of {', '.join(AREAS)}", repr(name), "Choose one of them."
            )
    return tuple(dict.fromkeys(names)) or tuple(AREAS)


def cases_of(area: str, quick_only: bool = False) -> tuple[Case[Any], ...]:
    """The cases of an area, or those of them that are part of the tests."""
    return tuple(case for case in AREAS[area] if case.quick or not quick_only)
