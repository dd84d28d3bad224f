"""From what a pickle holds to a plain structure: a tree of bounded size without records.

A few bytes can name one list a hundred times, within a list that is named a hundred times, and so
on: small in memory, endless for whoever walks through it. Such knots are counted as often as they
are met, and refused. Nothing here recurses, so depth cannot exhaust the stack.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.limits import CONTAINER_BYTES, Allowance, Limits, too_many_items
from mocoflow_core.io.untrusted.records import Admitted, Record
from mocoflow_core.io.untrusted.refusal import damaged

_LEAVES = (str, bytes, int, float, complex, type(None))


@dataclass(frozen=True, slots=True)
class _Made:
    source: object  # kept alive: its id is the key under which this is found
    value: object
    items: int  # with every repetition
    nbytes: int
    depth: int


def plain_tree(root: object, allowance: Allowance) -> object:
    """The same structure with every record replaced by what it stands for.

    Returns:
        dict, list, tuple, str, bytes, numbers, None and NumPy arrays only.

    Raises:
        InputError: it holds itself, is nested too deeply, or repeats itself too often.
    """
    made: dict[int, _Made] = {}
    begun: set[int] = set()
    waiting = [root]
    while waiting:
        value = waiting[-1]
        if id(value) in made:
            waiting.pop()
            continue
        missing = [child for child in _children(value, allowance) if id(child) not in made]
        if missing and id(value) in begun:
            raise damaged("a structure that holds itself")
        if id(value) not in begun:
            allowance.spend_bytes(CONTAINER_BYTES)
        begun.add(id(value))
        if missing:
            waiting.extend(missing)
            continue
        made[id(value)] = _make(value, made, allowance)
        waiting.pop()
    _require_little_repetition(made, made[id(root)], allowance)
    return made[id(root)].value


def _children(value: object, allowance: Allowance) -> Iterable[object]:
    """The parts that are not plain by nature."""
    if isinstance(value, list | tuple):
        parts: Iterable[object] = value
    elif isinstance(value, dict):
        parts = value.values()
    elif isinstance(value, Record):
        parts = (value.plain(allowance),)
    else:
        parts = ()
    return (part for part in parts if not isinstance(part, _LEAVES))


def _make(value: object, made: dict[int, _Made], allowance: Allowance) -> _Made:
    if isinstance(value, Record):
        inner = value.plain(allowance)
        found = made.get(id(inner))
        if found is not None:
            return _Made(value, found.value, found.items, found.nbytes, found.depth)
        return _Made(value, inner, 1, 0, 0)
    if isinstance(value, np.ndarray):
        return _Made(value, value, 1, value.nbytes, 0)
    if isinstance(value, _LEAVES):
        return _Made(value, value, 1, 0, 0)
    if isinstance(value, Admitted):
        raise InputError(
            "it must hold data", f"the name {value.name} in its place", "Save plain arrays."
        )
    return _container(value, made, allowance.limits)


def _container(value: object, made: dict[int, _Made], limits: Limits) -> _Made:
    if isinstance(value, dict):
        parts, rebuilt = list(value.values()), None
    elif isinstance(value, list | tuple):
        parts, rebuilt = list(value), type(value)
    else:
        raise damaged(f"{type(value).__name__} in place of data")
    nodes = [made[id(part)] for part in parts if not isinstance(part, _LEAVES)]
    plain = [part if isinstance(part, _LEAVES) else made[id(part)].value for part in parts]
    items = 1 + len(parts) + sum(node.items for node in nodes)
    nbytes = sum(node.nbytes for node in nodes)
    depth = 1 + max((node.depth for node in nodes), default=0)
    _require_modest(items, depth, limits)
    result = dict(zip(value, plain, strict=True)) if rebuilt is None else rebuilt(plain)
    return _Made(value, result, items, nbytes, depth)


def _require_little_repetition(made: dict[int, _Made], whole: _Made, allowance: Allowance) -> None:
    once = sum(part.nbytes for part in made.values() if isinstance(part.source, np.ndarray))
    allowance.spend_bytes(max(0, whole.nbytes - once))


def _require_modest(items: int, depth: int, limits: Limits) -> None:
    if depth > limits.depth:
        raise InputError(
            f"it must be nested at most {limits.depth} deep",
            "one that is deeper",
            "Get the file from its maker again.",
        )
    if items > limits.steps:
        raise too_many_items(limits)
