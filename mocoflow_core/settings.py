"""Single fields of a configuration, set by their dotted names."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError

Configuration = TypeVar("Configuration", bound=ConfigurationPart)


def with_settings(configuration: Configuration, settings: Sequence[str]) -> Configuration:
    """The configuration with settings such as ``schedule.fine_steps=500`` applied.

    Values are JSON where they can be read so, else text. Raises InputError for an unknown field,
    naming the closest one, and for a value that the field refuses.
    """
    values = configuration.model_dump()
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise InputError("A setting is written field=value", repr(setting), "Add the value.")
        _set(values, name.strip(), _value(text.strip()), configuration)
    try:
        return type(configuration).model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(step) for step in first["loc"])
        raise InputError(
            f"{field} must be valid", f"{first['input']!r:.60} ({first['msg']})", "Correct --set."
        ) from error


def field_names(configuration: BaseModel, prefix: str = "") -> Iterator[str]:
    """The dotted names of all fields that can be set."""
    for name in type(configuration).model_fields:
        value = getattr(configuration, name)
        if isinstance(value, BaseModel):
            yield from field_names(value, f"{prefix}{name}.")
        else:
            yield prefix + name


def _set(values: dict[str, Any], name: str, value: object, known: BaseModel) -> None:
    names = list(field_names(known))
    if name not in names:
        raise InputError(
            "--set needs a field of the configuration",
            repr(name),
            f"Did you mean {_closest(name, names)}?",
        )
    *parts, last = name.split(".")
    for part in parts:
        values = values[part]
    values[last] = value


def _closest(name: str, names: list[str]) -> str:
    """By spelling; a bare field name is compared with the last parts."""
    last_part = {known.rpartition(".")[2]: known for known in names}
    spelled = difflib.get_close_matches(name, names, n=1, cutoff=0.0)
    bare = difflib.get_close_matches(name.rpartition(".")[2], last_part, n=1, cutoff=0.75)
    return last_part[bare[0]] if bare else spelled[0]


def _value(text: str) -> object:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text
