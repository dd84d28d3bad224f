"""One checked mesh for each frame, in world metres wherever its location is known."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

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
from mocoflow_core.capture.scene_description import Coordinates
from mocoflow_core.errors import InputError

FIRST_TRANSLATIONS = "first_translations.npy"


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


def ingest_sequence(
    scene: Scene,
    raw: MeshSequence,
    coordinates: Coordinates,
    located: bool,
    is_scenes_own: bool,
    first_translations: NDArray[np.float64] | None = None,
    remarks: tuple[str, ...] = (),
) -> IngestedMeshes:
    """Check meshes as they were read and join them to the train camera's frames.

    Args:
        raw: ascending in time.
        coordinates, located: where they stand, as stated.
        is_scenes_own: whether they are the meshes that ``scene.json`` names.
        first_translations: (T, 3), about where root-centred ones stand.
        remarks: what whoever read them has to say.

    Raises InputError for non-finite vertices, another frame count, another unit; and for the
    scene's own meshes in the axes of another train camera.
    """
    require_shapes(raw)
    require_finite(raw)
    require_metres(raw)
    expected = scene.frames(scene.train_camera).indices
    require_contiguous(expected, f"frames of {scene.train_camera}")
    require_frames(raw, expected, scene.description.fps)
    faces, face_warnings = _proper_faces(raw)
    joined, first, gap_warnings = _joined(replace(raw, faces=faces), first_translations, expected)
    root_centred = coordinates == "camera-root-centred"
    located = located and not root_centred
    camera_warnings = _of_another_camera(scene, coordinates) if is_scenes_own else ()
    camera = scene.cameras[scene.train_camera]
    if coordinates == "camera":
        world = camera.to_world(joined.vertices.astype(np.float64))
        joined = replace(joined, vertices=world.astype(np.float32))
    require_near_origin(joined)
    if located:
        require_in_front(joined, camera)
    warnings = face_warnings + gap_warnings + camera_warnings
    return IngestedMeshes(
        joined,
        "camera-root-centred" if root_centred else "world",
        located,
        remarks + warnings + check_frozen(raw) + check_turns(raw),
        first,
    )


def _of_another_camera(scene: Scene, coordinates: Coordinates) -> tuple[str, ...]:
    """What to know of meshes that were given for a camera that is now one of the others.

    Raises InputError where they stand in that camera's axes.
    """
    if not scene.is_seen_from_elsewhere:
        return ()
    if coordinates != "world":
        raise InputError(
            f"meshes for {scene.train_camera}, or in world coordinates",
            f"those of the scene, in the axes of {scene.meshes_for}",
            f"Give an estimate made from {scene.train_camera} with --meshes.",
        )
    return (
        f"the meshes were given for {scene.meshes_for}, which now evaluates: if they were "
        "estimated from its pictures, its scores are not those of unseen views",
    )


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
    meshes: MeshSequence, first: NDArray[np.float64] | None, expected: NDArray[np.int32]
) -> tuple[MeshSequence, NDArray[np.float64] | None, tuple[str, ...]]:
    """One mesh for each expected frame; missing ones lie on the line between their neighbours.

    ``first`` (T, 3): translations, which do the same.
    """
    given = meshes.frame_indices
    missing = np.setdiff1d(expected, given)
    if not len(missing):
        return meshes, first, ()
    after = np.searchsorted(given, expected).clip(1)
    before = after - 1
    share = (expected - given[before]) / (given[after] - given[before])
    steps = meshes.vertices[after] - meshes.vertices[before]
    vertices = meshes.vertices[before] + share[:, None, None].astype(np.float32) * steps
    if first is not None:
        first = first[before] + share[:, None] * (first[after] - first[before])
    warning = f"{len(missing)} frames without a mesh, the first {missing[0]}, are interpolated"
    return replace(meshes, frame_indices=expected, vertices=vertices), first, (warning,)
