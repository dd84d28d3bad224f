"""Bodies of ZJU-MoCap: which folder they come from, and where their faces do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_file import read_mesh
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.datasets.body_model_file import WHERE_TO_GET_IT, find_body_model
from mocoflow_core.datasets.dataset_scene import DatasetMeshes
from mocoflow_core.datasets.zju_parameters import posed_bodies, read_parameters, stored_vertices
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


@dataclass(frozen=True, eq=False)
class _Bodies:
    vertices: NDArray[np.float32]  # (T, V, 3)
    faces: NDArray[np.int32]  # (F, 3)
    remark: str | None


def read_bodies(
    folder: Path, numbers: NDArray[np.int32], source: BodySource
) -> tuple[DatasetMeshes | None, tuple[str, ...]]:
    """The bodies of the frames that have one, in world metres, and remarks.

    Raises InputError when no frame has one, and when faces or a body model are needed.
    """
    if source.choice == "none":
        return None, ("the bodies of the data set are not read: give some with --meshes",)
    kind, files = _files(folder, numbers, source)
    present = np.array(sorted(files), np.int32)
    paths = [files[number] for number in present.tolist()]
    stored = kind in ("new_vertices", "vertices")
    bodies = _stored(kind, paths, source) if stored else _posed(kind, paths, source)
    remarks = [f"bodies are those of {kind}"]
    if kind in OLD:
        remarks.append(
            f"{kind} were made without the pose blend shapes of SMPL, unlike new_{kind}: "
            "bodies bend less well"
        )
    if missing := len(numbers) - len(present):
        remarks.append(f"{missing} of {len(numbers)} frames have no file in {kind}")
    remarks += [bodies.remark] if bodies.remark else []
    sequence = MeshSequence(present, bodies.vertices, bodies.faces)
    meshes = DatasetMeshes(sequence, "world", True, f"ZJU-MoCap {kind} (multi-view fit)")
    return meshes, tuple(remarks)


def _files(
    folder: Path, numbers: NDArray[np.int32], source: BodySource
) -> tuple[BodyKind, dict[int, Path]]:
    """The first kind that has a body for any of the frames, and its files by frame number."""
    kinds: Sequence[BodyKind] = KINDS
    if source.choice != "best":
        kinds = (cast(BodyKind, source.choice),)
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


def _posed(kind: BodyKind, files: list[Path], source: BodySource) -> _Bodies:
    file, doubt = find_body_model(source.body_model, "neutral", f"pose the {kind} of ZJU-MoCap")
    model = read_smpl_model(file)
    vertices = posed_bodies(model, read_parameters(files), kind == "new_params")
    return _Bodies(vertices, np.asarray(model.faces, np.int32), doubt)


def _stored(kind: BodyKind, files: list[Path], source: BodySource) -> _Bodies:
    vertices = stored_vertices(files)
    faces, described = _faces(kind, source)
    if faces.max() >= vertices.shape[1]:
        raise InputError(
            f"faces of a body with {vertices.shape[1]} vertices",
            f"a face that names vertex {faces.max()}",
            "Give the faces of SMPL, which has 6890 vertices.",
        )
    return _Bodies(vertices, faces, f"{kind} come without faces: taken from {described}")


def _faces(kind: BodyKind, source: BodySource) -> tuple[NDArray[np.int32], str]:
    """Triangles (F, 3) of SMPL; every gender's and version's are the same."""
    if source.faces is not None:
        return read_mesh(source.faces)[1], source.faces.name
    if source.body_model is None:
        raise InputError(
            f"the faces of SMPL, which {kind} come without",
            "none",
            "Name any mesh of a SMPL body (.obj, .ply, .glb; such as consensus.obj of "
            f"People-Snapshot) with the field faces, or give a body model. {WHERE_TO_GET_IT}",
        )
    file = source.body_model
    if file.is_dir():
        file, _ = find_body_model(file, "neutral", f"take the faces of {kind} from")
    return np.asarray(read_smpl_model(file).faces, np.int32), file.name
