"""The project's own mesh file: vertices, faces and frame numbers as plain arrays in an ``.npz``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import get_args

import numpy as np

from mocoflow_core.capture.scene_description import Coordinates, MeshesDescription
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile
from mocoflow_core.estimators.tracks import Arrays

PARTS = ("faces", "frame_indices", "vertices")


def recognises(stored: EstimateFile) -> bool:
    """An archive with our arrays."""
    return isinstance(stored.content, Mapping) and set(stored.content) >= set(PARTS)


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """The arrays of a mesh file, ascending in time, and where they stand.

    A file may say its own ``coordinates`` and ``located``; the rest is taken from the scene.

    Raises InputError for a file that is no such archive, in words about it.
    """
    path, content = stored.path, stored.content
    given = content if isinstance(content, Mapping) else {}
    arrays = {name: part for name, part in given.items() if isinstance(part, np.ndarray)}
    missing = [name for name in PARTS if name not in arrays]
    if missing:
        raise InputError(
            f"{path.name} must hold vertices, faces and frame_indices",
            f"no {', '.join(missing)}",
            "Write the mesh file again with numpy.savez.",
        )
    order = np.argsort(arrays["frame_indices"], kind="stable")
    same_length = len(arrays["vertices"]) == len(order)
    regressor = arrays.get("keypoint_regressor")
    description = _description(path, arrays, context.described)
    return BodyEstimate(
        source=description.source,
        frame_indices=arrays["frame_indices"].astype(np.int32)[order],
        numbering="source",
        vertices=arrays["vertices"].astype(np.float32)[order if same_length else slice(None)],
        faces=arrays["faces"].astype(np.int32),
        coordinates=description.coordinates,
        located=description.located,
        keypoint_regressor=None if regressor is None else regressor.astype(np.float32),
    )


def _description(
    path: Path, arrays: Arrays, described: MeshesDescription | None
) -> MeshesDescription:
    fallback = described or MeshesDescription(file=path.name, coordinates="camera", located=True)
    coordinates = str(arrays.get("coordinates", fallback.coordinates))
    if coordinates not in get_args(Coordinates):
        raise InputError(
            f"coordinates must be one of {', '.join(get_args(Coordinates))}",
            f"{coordinates!r:.40}",
            f"Correct them in {path.name}.",
        )
    located = bool(arrays.get("located", fallback.located))
    return fallback.model_copy(update={"coordinates": coordinates, "located": located})
