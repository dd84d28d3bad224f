"""Bodies of ZJU-MoCap: which folder they come from, and where their faces do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_faces import read_faces
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.smpl_file import read_smpl_model, where_to_get
from mocoflow_core.datasets.body_model_file import find_body_model
from mocoflow_core.datasets.dataset_scene import DatasetMeshes
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.bodies import fitting_shapes
from mocoflow_core.estimators.easymocap import JOINTS, parameter_rows, turned_bodies
from mocoflow_core.io.untrusted import read_npy

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
    """The kind with bodies for most of the frames, the best of these, and its files by number."""
    kinds: Sequence[BodyKind] = KINDS
    if source.choice != "best":
        kinds = (cast(BodyKind, source.choice),)
    found = {kind: _present(folder / kind, numbers, source.number_offset) for kind in kinds}
    fullest = max(kinds, key=lambda kind: len(found[kind]))  # The first of equals.
    if found[fullest]:
        return fullest, found[fullest]
    first, last = numbers[0] + source.number_offset, numbers[-1] + source.number_offset
    raise InputError(
        f"body files {first}.npy to {last}.npy in {' or '.join(kinds)}",
        f"none in {folder}",
        "Add them; if they are numbered otherwise say so with body_number_offset (copies of "
        "CoreView_396 that count from frame 810: -810); or set bodies to none and give --meshes.",
    )


def _present(folder: Path, numbers: NDArray[np.int32], offset: int) -> dict[int, Path]:
    paths = {number: folder / f"{number + offset}.npy" for number in numbers.tolist()}
    return {number: path for number, path in paths.items() if path.is_file()}


def _posed(kind: BodyKind, files: list[Path], source: BodySource) -> _Bodies:
    file, doubt = find_body_model(source.body_model, "neutral", f"pose the {kind} of ZJU-MoCap")
    model = read_smpl_model(file)
    names = [f"{kind}/{path.name}" for path in files]
    rows = parameter_rows([read_npy(path) for path in files], names)
    vertices = turned_bodies(
        model,
        rows["poses"].reshape(-1, JOINTS, 3),
        fitting_shapes(rows["shapes"], model),
        rows["Rh"],
        rows["Th"],
        pose_blend_shapes=kind == "new_params",
    )
    return _Bodies(vertices.astype(np.float32), np.asarray(model.faces, np.int32), doubt)


def _stored(kind: BodyKind, files: list[Path], source: BodySource) -> _Bodies:
    vertices = _vertices(files)
    faces, described = _faces(kind, vertices.shape[1], source)
    return _Bodies(vertices, faces, f"{kind} come without faces: taken from {described}")


def _vertices(files: Sequence[Path]) -> NDArray[np.float32]:
    """Vertices (T, V, 3) as they lie in one plain array per frame."""
    bodies = [_body(file) for file in files]
    counts = sorted({len(body) for body in bodies})
    if len(counts) != 1:
        raise InputError(
            "as many vertices in each body file",
            f"{', '.join(map(str, counts))} in {files[0].parent.name}",
            "Take the files of one release.",
        )
    return np.stack(bodies).astype(np.float32)


def _body(file: Path) -> NDArray[np.float64]:
    content = read_npy(file)
    numeric = isinstance(content, np.ndarray) and content.dtype.kind in "iuf"
    body = np.asarray(content, np.float64) if numeric else np.empty(0)
    if body.ndim != 2 or body.shape[1] != 3 or not np.isfinite(body).all():
        raise InputError(
            f"vertices (V, 3) in {file.parent.name}/{file.name}",
            f"an array of shape {body.shape}",
            "Copy the file again.",
        )
    return body


def _faces(kind: BodyKind, vertices: int, source: BodySource) -> tuple[NDArray[np.int32], str]:
    """Triangles (F, 3) of SMPL; every gender's and version's are the same.

    Raises InputError where there are none, and where they are of another number of vertices.
    """
    if source.faces is not None:
        return read_faces(source.faces, vertices), source.faces.name
    if source.body_model is None:
        raise InputError(
            f"the faces of SMPL, which {kind} come without",
            "none",
            "Name any mesh of a SMPL body (.obj, .ply, .glb; such as consensus.obj of "
            f"People-Snapshot) with the field faces, or give a body model. {where_to_get()}",
        )
    file = source.body_model
    if file.is_dir():
        file, _ = find_body_model(file, "neutral", f"take the faces of {kind} from")
    return read_faces(file, vertices), file.name
