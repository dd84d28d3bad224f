"""What is known beside an estimate's own file: the camera, the user's choices, the body model."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_faces import read_faces
from mocoflow_core.body.smpl_file import Family, missing_model, read_smpl_model, where_to_get
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.capture.scene_description import MeshesDescription
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.progress import Progress, untold

# What tools' bodies are made of, told by its joints.
JOINTS: dict[Family, int] = {"SMPL": 24, "SMPL-X": 55}


@dataclass(frozen=True, eq=False)
class EstimateContext:
    """The train camera as the tool saw its pictures, and what the user has said and given."""

    camera: Camera
    chosen: EstimateConfig = field(default_factory=EstimateConfig)
    described: MeshesDescription | None = None  # of the scene's meshes
    progress: Progress = untold

    @cached_property
    def model(self) -> SmplModel | None:
        """The user's body model, if one is given."""
        return read_smpl_model(self.chosen.body_model) if self.chosen.body_model else None

    def require_model(self, tool: str, family: Family) -> SmplModel:
        """The body model of a family. Raises InputError where another one or none is given."""
        if self.model is None:
            needed = f"{tool} stores pose and shape, which need the {family} body model"
            raise missing_model("none", family, needed)
        joints, found = JOINTS[family], len(self.model.parents)
        if found != joints:
            raise InputError(
                f"{tool} needs the {family} body model, which has {joints} joints",
                f"a model with {found} joints",
                f"Shapes and poses of other models mean something else. {where_to_get(family)}",
            )
        return self.model

    def faces(self, tool: str, vertices: int) -> NDArray[np.int32]:
        """Faces for a tool's bodies, which bring none.

        From the file named for it or the body model. Raises InputError where neither fits.
        """
        if self.chosen.faces:
            return read_faces(self.chosen.faces, vertices)
        if self.chosen.body_model:
            return read_faces(self.chosen.body_model, vertices)
        raise InputError(
            f"{tool} stores no faces; they come from a body model or from a mesh",
            "none",
            f"{where_to_get()} Or give any mesh of this topology (OBJ, PLY, OFF, GLB, meshes.npz) "
            "with --set meshes.faces=FILE.",
        )
