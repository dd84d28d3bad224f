"""From a mesh file to one checked sequence, in world metres wherever its location is known."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_checks import (
    require_finite,
    require_frames,
    require_in_front,
    require_metres,
    require_near_origin,
    require_shapes,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.motion_checks import check_frozen, check_turns
from mocoflow_core.capture.frame_selection import require_contiguous
from mocoflow_core.capture.scene import Scene
from mocoflow_core.capture.scene_description import MeshesDescription
from mocoflow_core.errors import InputError

FileCoordinates = Literal["world", "camera", "camera-root-centred"]
FIRST_TRANSLATIONS = "first_translations.npy"

# What numpy raises for files of all sorts; a TypeError where the file is a single array.
_UNREADABLE = (ValueError, TypeError, OSError, EOFError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True, eq=False)
class IngestedMeshes:
    """A mesh for every source frame of the train camera.

    ``coordinates`` "world": world metres. "camera-root-centred": the train camera's axes, the
    translation unknown in each frame. ``located`` false asks for a location search.
    ``first_translations`` (T, 3), metres in the train camera's axes: about where root-centred
    bodies stand, such as a weak perspective camera says; nan in frames without one.
    """

    meshes: MeshSequence
    coordinates: Literal["world", "camera-root-centred"]
    located: bool
    warnings: tuple[str, ...] = ()
    first_translations: NDArray[np.float64] | None = None

    def save(self, folder: Path) -> None:
        """Write ``meshes.npz``, ``ingested.json`` and what else there is into a folder."""
        self.meshes.save(folder / "meshes.npz")
        if self.first_translations is not None:
            np.save(folder / FIRST_TRANSLATIONS, self.first_translations)
        values = {
            "coordinates": self.coordinates,
            "located": self.located,
            "warnings": self.warnings,
        }
        (folder / "ingested.json").write_text(json.dumps(values, indent=1))

    @classmethod
    def load(cls, folder: Path) -> IngestedMeshes:
        """Inverse of ``save``."""
        values = json.loads((folder / "ingested.json").read_text())
        first = folder / FIRST_TRANSLATIONS
        return cls(
            MeshSequence.load(folder / "meshes.npz"),
            values["coordinates"],
            values["located"],
            tuple(values["warnings"]),
            np.load(first, allow_pickle=False) if first.exists() else None,
        )


def ingest_meshes(scene: Scene, meshes_override: Path | None = None) -> IngestedMeshes:
    """Read, check and join the body meshes to the train camera's frames.

    An override file may say its own ``coordinates`` and ``located``; what it does not say is taken
    from the scene. Frames missing inside are interpolated when the gap is short, with a warning.

    Raises InputError for a file that is no mesh sequence, non-finite vertices, another frame
    count, another unit; and for the scene's own meshes in the axes of another train camera.
    """
    path = meshes_override or scene.meshes()
    if path is None or not path.is_file():
        raise InputError(
            "a body mesh for each frame",
            "none" if path is None else f"no file {path}",
            "Name a mesh file in scene.json, or give one with --meshes.",
        )
    raw, description = _read(path, scene.description.meshes)
    require_shapes(raw)
    require_finite(raw)
    require_metres(raw)
    expected = scene.frames(scene.train_camera).indices
    require_contiguous(expected, f"frames of {scene.train_camera}")
    require_frames(raw, expected, scene.description.fps)
    faces, face_warnings = _proper_faces(raw)
    joined, gap_warnings = _joined(replace(raw, faces=faces), expected)
    root_centred = description.coordinates == "camera-root-centred"
    located = description.located and not root_centred
    camera_warnings = _of_another_camera(scene, path, description)
    camera = scene.cameras[scene.train_camera]
    if description.coordinates == "camera":
        world = camera.to_world(joined.vertices.astype(np.float64))
        joined = replace(joined, vertices=world.astype(np.float32))
    require_near_origin(joined)
    if located:
        require_in_front(joined, camera)
    return IngestedMeshes(
        joined,
        "camera-root-centred" if root_centred else "world",
        located,
        face_warnings + gap_warnings + camera_warnings + check_frozen(raw) + check_turns(raw),
    )


def _of_another_camera(scene: Scene, path: Path, description: MeshesDescription) -> tuple[str, ...]:
    """What to know of meshes that were given for a camera that is now one of the others.

    Raises InputError where they stand in that camera's axes.
    """
    if path != scene.meshes() or not scene.is_seen_from_elsewhere:
        return ()
    if description.coordinates != "world":
        raise InputError(
            f"meshes for {scene.train_camera}, or in world coordinates",
            f"those of the scene, in the axes of {scene.meshes_for}",
            f"Give an estimate made from {scene.train_camera} with --meshes.",
        )
    return (
        f"the meshes were given for {scene.meshes_for}, which now evaluates: if they were "
        "estimated from its pictures, its scores are not those of unseen views",
    )


def _read(
    path: Path, described: MeshesDescription | None
) -> tuple[MeshSequence, MeshesDescription]:
    """The arrays of a mesh file, ascending in time, and where they stand."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except _UNREADABLE as error:
        raise InputError(
            f"{path.name} must be an .npz with vertices, faces and frame_indices as plain arrays",
            _what_it_is(path),
            "Export it again with numpy.savez.",
        ) from error
    needed = ("faces", "frame_indices", "vertices")
    missing = [name for name in needed if not isinstance(arrays.get(name), np.ndarray)]
    if missing:
        raise InputError(
            f"{path.name} must hold vertices, faces and frame_indices",
            f"no {', '.join(missing)}",
            "Write the mesh file again.",
        )
    order = np.argsort(arrays["frame_indices"], kind="stable")
    same_length = len(arrays["vertices"]) == len(order)
    regressor = arrays.get("keypoint_regressor")
    meshes = MeshSequence(
        arrays["frame_indices"].astype(np.int32)[order],
        arrays["vertices"].astype(np.float32)[order if same_length else slice(None)],
        arrays["faces"].astype(np.int32),
        None if regressor is None else regressor.astype(np.float32),
    )
    return meshes, _description(path, arrays, described)


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


def _proper_faces(meshes: MeshSequence) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    """The faces that have three vertices, winding so that their normals point outwards."""
    faces, warnings = meshes.faces, []
    proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if not proper.any():
        raise InputError("faces with three vertices each", "none", "Correct the faces.")
    if not proper.all():
        warnings.append(f"{(~proper).sum()} faces name a vertex twice and are left out")
        faces = faces[proper]
    body = meshes.vertices[0].astype(np.float64)
    first, second, third = np.moveaxis((body - body.mean(axis=0))[faces], 1, 0)
    if (first * np.cross(second, third)).sum() < 0:
        warnings.append("the faces wind inwards and are turned over")
        faces = np.ascontiguousarray(faces[:, ::-1])
    return faces, tuple(warnings)


def _joined(
    meshes: MeshSequence, expected: NDArray[np.int32]
) -> tuple[MeshSequence, tuple[str, ...]]:
    """One mesh for each expected frame; missing ones lie on the line between their neighbours."""
    given = meshes.frame_indices
    missing = np.setdiff1d(expected, given)
    if not len(missing):
        return meshes, ()
    after = np.searchsorted(given, expected).clip(1)
    before = after - 1
    share = (expected - given[before]) / (given[after] - given[before])
    steps = meshes.vertices[after] - meshes.vertices[before]
    vertices = meshes.vertices[before] + share[:, None, None].astype(np.float32) * steps
    warning = f"{len(missing)} frames without a mesh, the first {missing[0]}, are interpolated"
    return replace(meshes, frame_indices=expected, vertices=vertices), (warning,)
