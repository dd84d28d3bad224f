"""Which tool an estimate is of: told by its content, whatever its name."""

from __future__ import annotations

from collections.abc import Mapping

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import Kind
from mocoflow_core.estimators.estimate_file import EstimateFile, what_is_in
from mocoflow_core.estimators.readers import READERS


def detect(stored: EstimateFile) -> Kind:
    """The kind whose layout the content has.

    Raises InputError where it has none or several, with what was found and the kinds there are.
    """
    found = [kind for kind, reader in READERS.items() if reader.recognises(stored)]
    if len(found) == 1:
        return found[0]
    kinds = ", ".join(f"{kind} ({reader.title})" for kind, reader in READERS.items())
    if found:
        raise InputError(
            "meshes of one kind",
            f"{what_is_in(stored)} in {stored.path.name}, which could be {' or '.join(found)}",
            f"Say which it is with --set meshes.kind={found[0]}.",
        )
    raise InputError(
        f"an estimate of one of the kinds {kinds}",
        f"{what_is_in(stored)} in {stored.path.name}{_advice(stored)}",
        "Give the file as the tool wrote it, or force its kind with --set meshes.kind=KIND.",
    )


def _advice(stored: EstimateFile) -> str:
    """Files that are often taken for the right ones."""
    content = stored.content
    first = next(iter(content.values()), None) if isinstance(content, Mapping) else None
    if isinstance(first, Mapping) and "gt_bbox" in first:
        return ", which PHALP reads and does not write: its results are results/demo_<video>.pkl"
    if isinstance(content, Mapping) and {"world_cam_R", "pred_cam_R"} & set(content):
        return ", TRAM's camera: give its folder results/<video>"
    return ""
