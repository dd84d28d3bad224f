"""Bodies of ZJU-MoCap from their files: EasyMocap's parameters, or stored vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.easymocap import turned_bodies
from mocoflow_core.io.untrusted import read_npy

Array = NDArray[np.float64]
JOINTS = 24


@dataclass(frozen=True, eq=False)
class ZjuParameters:
    """Pose and place of the body in T frames, world metres."""

    rotations: Array  # (T, 3) axis-angle about the world's origin
    translations: Array  # (T, 3)
    poses: Array  # (T, 24, 3) axis-angle, joint 0 without rotation
    shapes: Array  # (T, S)


def read_parameters(files: Sequence[Path]) -> ZjuParameters:
    """One file per frame: ``Rh`` (1, 3), ``Th`` (1, 3), ``poses`` (1, 72), ``shapes`` (1, 10).

    Raises InputError for other contents.
    """
    columns = {"Rh": 3, "Th": 3, "poses": 3 * JOINTS}
    contents = [_parameters(file) for file in files]
    rows = {
        key: np.stack(
            [_row(content, key, file, count) for content, file in zip(contents, files, strict=True)]
        )
        for key, count in columns.items()
    }
    shapes = [
        _row(content, "shapes", file, None) for content, file in zip(contents, files, strict=True)
    ]
    fewest = min(len(shape) for shape in shapes)
    return ZjuParameters(
        rows["Rh"],
        rows["Th"],
        rows["poses"].reshape(-1, JOINTS, 3),
        np.stack([shape[:fewest] for shape in shapes]),
    )


def posed_bodies(
    model: SmplModel, parameters: ZjuParameters, pose_blend_shapes: bool
) -> NDArray[np.float32]:
    """Vertices (T, V, 3) in world metres; coefficients the model has no directions for are left."""
    bodies = turned_bodies(
        model,
        parameters.poses,
        parameters.shapes[:, : model.shape_directions.shape[-1]],
        parameters.rotations,
        parameters.translations,
        pose_blend_shapes,
    )
    return bodies.astype(np.float32)


def stored_vertices(files: Sequence[Path]) -> NDArray[np.float32]:
    """Vertices (T, V, 3) as they lie in one plain array per frame.

    Raises InputError for other contents, and for bodies of several topologies.
    """
    bodies = [_vertices(file) for file in files]
    counts = {len(body) for body in bodies}
    if len(counts) != 1:
        raise InputError(
            "as many vertices in each body file",
            f"{', '.join(map(str, sorted(counts)))} in {files[0].parent.name}",
            "Take the files of one release.",
        )
    return np.stack(bodies).astype(np.float32)


def _vertices(file: Path) -> Array:
    try:
        body = np.asarray(read_npy(file), np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        body = np.empty(0)
    if body.ndim != 2 or body.shape[1] != 3 or not np.isfinite(body).all():
        raise InputError(
            f"vertices (V, 3) in {file.parent.name}/{file.name}",
            f"an array of shape {body.shape}",
            "Copy the file again.",
        )
    return body


def _parameters(file: Path) -> dict[str, object]:
    content = read_npy(file)
    if not isinstance(content, dict):
        raise InputError(
            f"Rh, Th, poses and shapes in {file.parent.name}/{file.name}",
            type(content).__name__,
            "Copy the file again.",
        )
    return content


def _row(content: dict[str, object], key: str, file: Path, count: int | None) -> Array:
    try:
        values = np.asarray(content.get(key), np.float64).reshape(-1)
    except (TypeError, ValueError):
        values = np.empty(0)
    if not len(values) or not np.isfinite(values).all() or (count or len(values)) != len(values):
        raise InputError(
            f"{key} of {count or 'some'} finite numbers in {file.parent.name}/{file.name}",
            f"{content.get(key)!r:.60}",
            "Copy the file again.",
        )
    return values
