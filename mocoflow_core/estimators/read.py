"""From a path to one person's bodies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig, Kind
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.detect import detect
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile
from mocoflow_core.estimators.readers import READERS

# Read by all kinds, or by whoever has a use for them: files lie ready for several scenes.
_ALWAYS = {"kind", "body_model", "faces"}


def read_estimate(path: Path, context: EstimateContext) -> BodyEstimate:
    """The bodies that a tool's file or folder holds, for one person.

    Raises InputError for unknown or damaged content, for a person who is not in it, for a body
    model that is needed and not given, and for settings that its kind does not read.
    """
    stored = EstimateFile(path)
    kind = kind_of(stored, context.chosen)
    _require_read(context.chosen, kind)
    with (
        _as_written_by(READERS[kind].title, path),
        np.errstate(divide="ignore", invalid="ignore", over="ignore"),
    ):
        estimate = READERS[kind].read(stored, context)
    if not context.chosen.first_frame:
        return estimate
    later = (estimate.frame_indices + context.chosen.first_frame).astype(np.int32)
    return replace(estimate, frame_indices=later)


def kind_of(stored: EstimateFile, chosen: EstimateConfig) -> Kind:
    """The kind that was chosen, else the one told by the content. Raises InputError as it does."""
    if chosen.kind != "auto":
        return chosen.kind
    with _as_written_by("one of the known tools", stored.path):
        return detect(stored)


@contextmanager
def _as_written_by(tool: str, path: Path) -> Iterator[None]:
    """Arrays of another size, type or nesting than the tool's: bad input, whatever they cause."""
    try:
        yield
    except InputError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"an estimate as {tool} writes it",
            f"other arrays in {path.name} ({type(error).__name__}: {str(error).splitlines()[:1]})",
            "Write the estimate again.",
        ) from error


def _require_read(chosen: EstimateConfig, kind: Kind) -> None:
    """Raise InputError for a setting that the kind would ignore."""
    default = EstimateConfig()
    for name in type(chosen).model_fields:
        if name in _ALWAYS | READERS[kind].fields or getattr(chosen, name) == getattr(
            default, name
        ):
            continue
        readers = [other.title for other in READERS.values() if name in other.fields]
        raise InputError(
            f"meshes.{name} needs an estimate that reads it ({'; '.join(readers)})",
            f"one of {READERS[kind].title}",
            f"Leave meshes.{name} out.",
        )
