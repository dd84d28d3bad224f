"""Bodies of ZJU-MoCap: vertices as stored, or posed from their parameters; one file per frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.datasets.dataset_scene import DatasetMeshes
from mocoflow_core.datasets.zju_parameters import posed_bodies, stored_vertices
from mocoflow_core.datasets.face_list import read_faces
from mocoflow_core.errors import InputError

BodyKind = Literal["new_vertices", "new_params", "vertices", "params"]
BodyChoice = Literal["best", "new_vertices", "new_params", "vertices", "params", "none"]
# The best first: stored vertices need no model's parameters, and only the new pair was made with
# the pose blend shapes of SMPL.
KINDS: tuple[BodyKind, ...] = ("new_vertices", "new_params", "vertices", "params")
OLD = ("vertices", "params")


@dataclass(frozen=True)
class BodySource:
    """Where bodies are taken from; files are the user's."""

    choice: BodyChoice = "best"
    number_offset: int = 0  # of a body file against its picture
    faces: Path | None = None
    body_model: Path | None = None


def read_bodies(
    folder: Path, numbers: NDArray[np.int32], source: BodySource
) -> tuple[DatasetMeshes | None, tuple[str, ...]]:
    """The bodies of the frames that have one, in world metres, and remarks.

    Raises InputError when no frame has one, and when faces or a body model are needed.
    """
    if source.choice == "none":
        return None, ("the bodies of the data set are not read: give some with --meshes",)
    kind, files = _files(folder, numbers, source)
    remarks = [f"bodies are those of {kind}"]
    if kind in OLD:
        remarks.append(
            f"{kind} were made without the pose blend shapes of SMPL, unlike new_{kind}: "
            "bodies bend less well"
        )
    present = np.array(sorted(files), np.int32)
    if missing := len(numbers) - len(present):
        remarks.append(f"{missing} of {len(numbers)} frames have no file in {kind}")
    paths = [files[number] for number in present.tolist()]
    if kind in ("vertices", "new_vertices"):
        vertices = stored_vertices(paths)
        faces, remark = read_faces(source.faces, source.body_model, "new_vertices or vertices")
    else:
        vertices, faces, remark = posed_bodies(paths, source.body_model, kind == "new_params")
    remarks += [remark] if remark else []
    _require_topology(vertices, faces)
    sequence = MeshSequence(present, vertices, faces)
    meshes = DatasetMeshes(sequence, "world", True, f"ZJU-MoCap {kind} (multi-view fit)")
    return meshes, tuple(remarks)


def _files(
    folder: Path, numbers: NDArray[np.int32], source: BodySource
) -> tuple[BodyKind, dict[int, Path]]:
    """The first kind that has a body for any of the frames, and its files by frame number."""
    kinds: Sequence[BodyKind] = KINDS if source.choice == "best" else (source.choice,)  # type: ignore[assignment]
    for kind in kinds:
        paths = {
            number: folder / kind / f"{number + source.number_offset}.npy"
            for number in numbers.tolist()
        }
        if files := {number: path for number, path in paths.items() if path.is_file()}:
            return kind, files
    first, last = numbers[0] + source.number_offset, numbers[-1] + source.number_offset
    raise InputError(
        f"body files {first}.npy to {last}.npy in {' or '.join(kinds)}",
        f"none in {folder}",
        "Add them; if they are numbered otherwise say so with body_number_offset (copies of "
        "CoreView_396 that count from frame 810: -810); or set bodies to none and give --meshes.",
    )


def _require_topology(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    if faces.max() >= vertices.shape[1]:
        raise InputError(
            f"faces of a body with {vertices.shape[1]} vertices",
            f"a face that names vertex {faces.max()}",
            "Give the faces of SMPL, with its 6890 vertices.",
        )
