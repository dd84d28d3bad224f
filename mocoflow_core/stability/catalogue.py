"""All areas and their cases. A new area is one file with its ``CASES`` and one line here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mocoflow_core.errors import InputError
from mocoflow_core.stability import compositing, encoding, rays_and_boxes, se3
from mocoflow_core.stability.case import Case

AREAS: dict[str, tuple[Case[Any], ...]] = {
    "se3": se3.CASES,
    "encoding": encoding.CASES,
    "compositing": compositing.CASES,
    "rays_and_boxes": rays_and_boxes.CASES,
}


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
