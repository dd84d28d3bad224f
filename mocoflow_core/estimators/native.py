"""The project's own mesh file: vertices, faces and frame numbers as plain arrays in an ``.npz``."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.ingest import FileCoordinates
from mocoflow_core.capture.scene_description import MeshesDescription
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.known import Known
from mocoflow_core.estimators.stored import Stored

PARTS = ("faces", "frame_indices", "vertices")

# What numpy raises for files of all sorts; a TypeError where the file is a single array.
_UNREADABLE = (ValueError, TypeError, OSError, EOFError, zipfile.BadZipFile, zlib.error)


def recognises(stored: Stored) -> bool:
    """An archive with our arrays."""
    return isinstance(stored.content, Mapping) and set(stored.content) >= set(PARTS)


def read(stored: Stored, known: Known) -> BodyEstimate:
    """The arrays of a mesh file, ascending in time, and where they stand.

    A file may say its own ``coordinates`` and ``located``; the rest is taken from the scene.

    Raises InputError for a file that is no such archive, in words about it.
    """
    path = stored.path
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except _UNREADABLE as error:
        raise InputError(
            f"{path.name} must be an .npz with vertices, faces and frame_indices as plain arrays",
            _what_it_is(path),
            "Export it again with numpy.savez.",
        ) from error
    missing = [name for name in PARTS if not isinstance(arrays.get(name), np.ndarray)]
    if missing:
        raise InputError(
            f"{path.name} must hold vertices, faces and frame_indices",
            f"no {', '.join(missing)}",
            "Write the mesh file again.",
        )
    order = np.argsort(arrays["frame_indices"], kind="stable")
    same_length = len(arrays["vertices"]) == len(order)
    regressor = arrays.get("keypoint_regressor")
    description = _description(path, arrays, known.described)
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


def _what_it_is(path: Path) -> str:
    """Why NumPy cannot read a file, in words of our own: its words are about pickles."""
    if not path.stat().st_size:
        return "an empty file"
    if not zipfile.is_zipfile(path):
        return "a file that is no .npz archive"
    return "an archive with damaged entries or Python objects"


def _description(
    path: Path, arrays: dict[str, NDArray[np.generic]], described: MeshesDescription | None
) -> MeshesDescription:
    fallback = described or MeshesDescription(file=path.name, coordinates="camera", located=True)
    coordinates = str(arrays.get("coordinates", fallback.coordinates))
    if coordinates not in get_args(FileCoordinates):
        raise InputError(
            f"coordinates must be one of {', '.join(get_args(FileCoordinates))}",
            f"{coordinates!r:.40}",
            f"Correct them in {path.name}.",
        )
    located = bool(arrays.get("located", fallback.located))
    return fallback.model_copy(update={"coordinates": coordinates, "located": located})
