"""The bodies of a People-Snapshot subject, posed from its parameters with the user's SMPL model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.datasets.body_model_file import find_body_model
from mocoflow_core.datasets.snapshot_files import Array, ConsensusBody, TrackedBody
from mocoflow_core.errors import InputError

BodyShape = Literal["clothed", "consensus", "tracking"]
SnapshotGender = Literal["by name", "female", "male"]


@dataclass(frozen=True, eq=False)
class SnapshotBodies:
    """Poses any rows of the tracking; rows that do not exist are left out."""

    model: SmplModel
    tracked: TrackedBody
    shape: Array  # (S,)
    offsets: Array | None  # (V, 3) metres

    def pose(self, rows: NDArray[np.int32]) -> MeshSequence:
        """LBS(template + S(shape) + offsets, pose) + translation, the camera's axes and metres.

        Offsets move no joints, as in the authors' model.
        """
        rows = rows[(rows >= 0) & (rows < len(self.tracked.pose))]
        vertices = posed_vertices(
            self.model,
            self.tracked.pose[rows],
            self.shape,
            self.tracked.translation[rows],
            self.offsets,
        )
        faces = np.asarray(self.model.faces, np.int32)
        return MeshSequence(rows, np.asarray(vertices, np.float32), faces)


def gender_of(subject: str, chosen: SnapshotGender) -> Literal["female", "male"] | None:
    """By the folder's name, if at all; "male" is a part of "female", which is asked for first."""
    if chosen != "by name":
        return chosen
    name = subject.lower()
    return "female" if "female" in name else "male" if "male" in name else None


def open_bodies(
    subject: str,
    tracked: TrackedBody,
    consensus: ConsensusBody | None,
    body_model: Path | None,
    gender: SnapshotGender,
    shape: BodyShape,
) -> tuple[SnapshotBodies, list[str]]:
    """Read the body model of the subject's gender; remarks say what is posed.

    Raises InputError without a model, with one of another topology, and for a folder whose name
    does not tell the gender, unless the model is given as a file.
    """
    needed = gender_of(subject, gender)
    if needed is None and (body_model is None or not body_model.is_file()):
        raise InputError(
            "a folder named <gender>-<number>-<clothing>, as female-3-casual",
            subject,
            "Rename it, or say the field gender=female or gender=male.",
        )
    model, remarks = _model(body_model, needed)
    if shape == "tracking" or consensus is None:
        remarks.append(
            "bodies have the shape of the tracking (reconstructed_poses.hdf5): unclothed"
        )
        return SnapshotBodies(model, tracked, tracked.shape, None), remarks
    if len(consensus.offsets) != len(model.template):
        raise InputError(
            f"a body model with the {len(consensus.offsets)} vertices of consensus.pkl",
            f"{len(model.template)} vertices",
            "SMPL has 6890; SMPL-X and SMPL-H do not fit.",
        )
    offsets = consensus.offsets if shape == "clothed" else None
    remarks.append(
        f"bodies have the consensus shape, {'clothed' if shape == 'clothed' else 'bare'}"
    )
    return SnapshotBodies(model, tracked, consensus.shape, offsets), remarks


def _model(
    given: Path | None, gender: Literal["female", "male"] | None
) -> tuple[SmplModel, list[str]]:
    remarks = []
    if gender is None:
        assert given is not None
        file = given
        remarks.append(f"the folder's name tells no gender: the model is {file.name} as given")
    else:
        file, doubt = find_body_model(
            given,
            gender,
            "pose this subject (consensus.obj has its faces and its T-pose only). Without it, "
            "import pictures, masks and camera with the field bodies=none and give an estimate "
            "with --meshes",
        )
        remarks.append(f"the {gender} body model is {file.name}")
        remarks += [doubt] if doubt else []
    return read_smpl_model(file), remarks
