"""What a body model must satisfy before a body is posed with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError

# Files in half precision round their weights by up to this much over a row.
ROW_SUM_TOLERANCE = 1e-2
# An adult or a child with stretched arms, in metres; other units are off by ten or more.
PLAUSIBLE_SPAN_M = (0.4, 4.0)

_ACTION = "Download the model file again, or convert it again from the original."


def require_sane(model: SmplModel, path: Path) -> None:
    """Raise InputError unless the arrays belong together and describe a body in metres."""
    for check in (_shapes, _finite, _faces, _rows, _tree, _metres):
        fault = check(model)
        if fault is not None:
            required, found = fault
            raise InputError(f"{path}: {required}", found, _ACTION)


_Fault = tuple[str, str] | None


def _shapes(model: SmplModel) -> _Fault:
    joints = len(model.parents)
    vertices = len(model.template) if model.template.ndim else 0
    expected: dict[str, tuple[int | None, ...]] = {
        "template": (vertices, 3),
        "faces": (None, 3),
        "shape_directions": (vertices, 3, None),
        "pose_directions": (vertices, 3, 9 * (joints - 1)),
        "joint_regressor": (joints, vertices),
        "skinning_weights": (vertices, joints),
    }
    for name, shape in expected.items():
        found = getattr(model, name).shape
        same = len(found) == len(shape) and all(
            want in (None, have) for want, have in zip(shape, found, strict=True)
        )
        if not same or 0 in found[:1]:
            sizes = ", ".join("any" if size is None else str(size) for size in shape)
            return f"{name} must be ({sizes})", f"{found}"
    return None


def _finite(model: SmplModel) -> _Fault:
    names = ("template", "shape_directions", "pose_directions", "joint_regressor")
    for name in (*names, "skinning_weights"):
        if not np.isfinite(getattr(model, name)).all():
            return f"{name} must be finite", "NaN or infinity"
    return None


def _faces(model: SmplModel) -> _Fault:
    if model.faces.min() < 0 or model.faces.max() >= model.vertex_count:
        found = f"{model.faces.min()} to {model.faces.max()}"
        return f"faces must name vertices 0 to {model.vertex_count - 1}", found
    return None


def _rows(model: SmplModel) -> _Fault:
    for name in ("skinning_weights", "joint_regressor"):
        sums = getattr(model, name).sum(axis=1)
        worst = sums[np.abs(sums - 1).argmax()]
        if abs(worst - 1) > ROW_SUM_TOLERANCE:
            return f"each row of {name} must sum to one", f"a row that sums to {worst:.4g}"
    if model.skinning_weights.min() < -ROW_SUM_TOLERANCE:
        return "skinning_weights must not be negative", f"{model.skinning_weights.min():.4g}"
    return None


def _tree(model: SmplModel) -> _Fault:
    reached = {0}
    waiting = set(range(1, model.joint_count))
    while ready := {joint for joint in waiting if int(model.parents[joint]) in reached}:
        reached |= ready
        waiting -= ready
    if model.parents[0] != -1 or waiting:
        return "the joints must form a tree under joint 0", f"joints apart from it: {waiting}"
    return None


def _metres(model: SmplModel) -> _Fault:
    span = float(np.ptp(model.template, axis=0).max())
    low, high = PLAUSIBLE_SPAN_M
    if not low <= span <= high:
        return f"the template must be {low} to {high:g} m across", f"{span:.4g}"
    return None
