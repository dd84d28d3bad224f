"""A folder of meshes, one file per frame (OBJ, PLY or GLB), named by the frames' numbers."""

from __future__ import annotations

import numpy as np

from mocoflow_core.body.mesh_file import MESH_SUFFIXES, read_mesh
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, frame_numbers

TOOL = "meshes"


def recognises(stored: EstimateFile) -> bool:
    """A folder with mesh files."""
    return stored.is_folder and bool(stored.files(*MESH_SUFFIXES))


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """The meshes, metres, where the setting or the scene's description says.

    Raises InputError for a single file, for meshes of another topology than the first one, and
    for names without a number.
    """
    files = stored.files(*MESH_SUFFIXES) if stored.is_folder else []
    if not files:
        raise InputError(
            f"a folder of meshes ({', '.join(MESH_SUFFIXES)}), one for each frame",
            f"{stored.path.name}",
            "Name the folder.",
        )
    numbers = np.array(frame_numbers(file.name for file in files), np.int32)
    vertices, faces = read_mesh(files[0])
    bodies = [vertices]
    for file in files[1:]:
        context.progress(len(bodies) / len(files), file.name)
        others, their_faces = read_mesh(file)
        if others.shape != vertices.shape or not np.array_equal(their_faces, faces):
            raise InputError(
                "meshes with the same faces in every frame",
                f"{len(others)} vertices and {len(their_faces)} faces in {file.name}, where "
                f"{files[0].name} has {len(vertices)} and {len(faces)}, or others",
                "Export posed copies of one mesh; scans and reconstructions have to be registered.",
            )
        bodies.append(others)
    order = np.argsort(numbers)
    described = context.described
    coordinates = context.chosen.coordinates or (described.coordinates if described else "camera")
    return BodyEstimate(
        source=TOOL,
        frame_indices=numbers[order],
        numbering="source",
        vertices=np.stack(bodies).astype(np.float32)[order],
        faces=faces,
        coordinates=coordinates,
        located=coordinates != "camera-root-centred" and (not described or described.located),
        remarks=(f"the meshes are taken to stand in {_in_words(coordinates)}, in metres",),
    )


def _in_words(coordinates: str) -> str:
    return {
        "world": "the world",
        "camera": "the train camera's axes",
        "camera-root-centred": "the train camera's axes, each about its own origin",
    }[coordinates]
