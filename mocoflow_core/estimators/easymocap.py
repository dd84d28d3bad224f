"""EasyMocap's and ZJU-MoCap's parameters: SMPL bodies turned about the world's origin.

A folder with a file per frame, ``<i>.npy`` (one person) or ``<i>.json`` (a list of people), or one
of them. Layout: zju3dv/EasyMocap, doc/02_output.md; zju3dv/neuralbody, INSTALL.md.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.bodies import fitting_shapes, shapes_of
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, frame_numbers, read_stored
from mocoflow_core.estimators.tracks import Track, choose_track
from mocoflow_core.progress import Progress, untold

Array = NDArray[np.float64]

TOOL = "EasyMocap"
JOINTS = 24
# How many numbers each part of a frame's record has; shapes have as many as the fit wanted.
PARTS = {"Rh": 3, "Th": 3, "poses": 3 * JOINTS, "shapes": None}
# Neural Body's folder of bodies that were fitted without pose blend shapes.
WITHOUT_BLEND_SHAPES = "params"


def recognises(stored: EstimateFile) -> bool:
    """Records of one frame, or a folder of them."""
    if not stored.is_folder:
        return bool(_records(stored.content))
    files = stored.files(".npy", ".json")
    return any(_records(read_stored(file)) for file in files)


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person in the world of the calibration. Raises InputError without the SMPL model."""
    track, chosen = choose_track(_tracks(stored), context.chosen.person)
    model = context.require_model(TOOL, "SMPL")
    shape, remarks = shapes_of(fitting_shapes(track.rows("shapes"), model), context)
    with_blend_shapes = context.chosen.pose_blend_shapes == "on"
    if stored.path.name == WITHOUT_BLEND_SHAPES and with_blend_shapes:
        remarks = (
            *remarks,
            "a folder called params was fitted without pose blend shapes in Neural Body's release: "
            "then set meshes.pose_blend_shapes=off, or give new_params",
        )
    vertices = turned_bodies(
        model,
        track.floats("poses", JOINTS, 3),
        shape,
        track.floats("Rh", 3),
        track.floats("Th", 3),
        with_blend_shapes,
        context.progress,
    )
    return BodyEstimate(
        source=TOOL,
        frame_indices=track.frame_indices,
        numbering="source",
        vertices=vertices.astype(np.float32),
        faces=model.faces.astype(np.int32),
        coordinates="world",
        located=True,
        remarks=(*chosen, *remarks),
    )


def turned_bodies(
    model: SmplModel,
    poses: Array,
    shape: Array,
    Rh: Array,
    Th: Array,
    pose_blend_shapes: bool = True,
    progress: Progress = untold,
) -> Array:
    """Bodies (T, V, 3) in world metres: ``R(Rh) SMPL(poses, shape) + Th``, about the origin.

    Args:
        poses: (T, 24, 3) axis-angle, the first usually zero.
        shape: (S,) or (T, S).
        Rh, Th: (T, 3) axis-angle and metres.
        pose_blend_shapes: whether the bodies were fitted with them.
    """
    bodies = posed_vertices(
        model, poses, shape, pose_directions=pose_blend_shapes, progress=progress
    )
    turns = Rotation.from_rotvec(Rh).as_matrix()
    return np.einsum("tij,tvj->tvi", turns, bodies) + Th[:, None]


def parameter_rows(records: Sequence[object], names: Sequence[str]) -> dict[str, Array]:
    """The parts of one person's records, each (T, n), whatever axes of one they are stored with.

    Args:
        records: of T frames.
        names: of the files that they lie in.

    Raises InputError, which names the file, for parts that are missing, of another size (as those
    of SMPL-X and SMPL-H are) or not finite, and for shapes of several sizes.
    """
    rows = {
        part: [_row(record, part, count, name) for record, name in zip(records, names, strict=True)]
        for part, count in PARTS.items()
    }
    sizes = sorted({len(shape) for shape in rows["shapes"]})
    if len(sizes) > 1:
        raise InputError(
            "shapes of the same size in all frames",
            f"{' and '.join(map(str, sizes))} numbers",
            "Give the files of one fit.",
        )
    return {part: np.stack(values) for part, values in rows.items()}


def _row(record: object, part: str, count: int | None, name: str) -> Array:
    given = record.get(part) if isinstance(record, Mapping) else None
    try:
        values = np.asarray(given, np.float64).ravel()
    except (TypeError, ValueError):
        values = np.empty(0)
    if not len(values) or len(values) != (count or len(values)) or not np.isfinite(values).all():
        raise InputError(
            f"{part} of {count or 'some'} finite numbers in {name}",
            f"{given!r:.60}",
            "Copy the file again; bodies must be SMPL's.",
        )
    return values


def _records(content: object) -> list[Mapping[str, object]]:
    """The people of one frame; empty for what is none."""
    if isinstance(content, Mapping) and "annots" in content:
        content = content["annots"]
    records = content if isinstance(content, list) else [content]
    found = [one for one in records if isinstance(one, Mapping) and set(one) >= set(PARTS)]
    return found if len(found) == len(records) else []


def _tracks(stored: EstimateFile) -> list[Track]:
    files = stored.files(".npy", ".json") if stored.is_folder else [stored.path]
    people: dict[int | None, list[tuple[int, str, object]]] = defaultdict(list)
    for number, file in zip(frame_numbers(file.name for file in files), files, strict=True):
        content = read_stored(file)
        records = _records(content)
        if not records and not (isinstance(content, list) and not content):
            raise InputError(
                f"files of EasyMocap with {', '.join(PARTS)}", f"{file.name}", "Remove other files."
            )
        for record in records:
            people[_id(record)].append((number, file.name, record))
    tracks = []
    for person, found in people.items():
        numbers = np.array([number for number, _, _ in found], np.int32)
        rows = parameter_rows([record for *_, record in found], [name for _, name, _ in found])
        tracks.append(Track(person, numbers, rows))
    return tracks


def _id(record: Mapping[str, object]) -> int | None:
    given = record.get("id")
    return None if given is None else int(np.asarray(given).ravel()[0])
