"""The files that a configuration names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.perception.network_file import FileOfNetwork


def named_files(part: ConfigurationPart) -> Iterator[tuple[str, Path]]:
    """The dotted name of each field that names a file or a folder, and where that is."""
    for name, value in _values(part):
        if isinstance(value, Path):
            yield name, value
        elif isinstance(value, FileOfNetwork):
            yield name, value.path


def require_networks(part: ConfigurationPart) -> None:
    """Raise InputError for a network's file that is not there, by the name of its field."""
    for name, value in _values(part):
        if isinstance(value, FileOfNetwork):
            try:
                value.require()
            except InputError as error:
                raise InputError(
                    f"{name} must be {error.required}", error.got, error.action
                ) from error


def _values(part: ConfigurationPart, above: str = "") -> Iterator[tuple[str, object]]:
    for name in type(part).model_fields:
        value = getattr(part, name)
        if isinstance(value, ConfigurationPart):
            yield from _values(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value
