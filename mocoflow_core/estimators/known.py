"""What is known beside an estimate's own file: the camera, the user's choices, the body model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.capture.scene_description import MeshesDescription
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.mesh_file import read_faces
from mocoflow_core.geometry.camera import Camera

# What tools' bodies are made of: joints of the model, and where users get it.
MODELS = {
    "SMPL": (24, "smpl.is.tue.mpg.de or smplify.is.tue.mpg.de"),
    "SMPL-X": (55, "smpl-x.is.tue.mpg.de"),
}
NEED_NO_MODEL = (
    "Estimates that bring vertices (VIBE, WHAM, ROMP with its meshes) need faces alone: name a "
    "mesh of the same topology with --set meshes.faces=FILE."
)


@dataclass(frozen=True, eq=False)
class Known:
    """The train camera as the tool saw its pictures, and what the user has said and given."""

    camera: Camera
    chosen: EstimateConfig = EstimateConfig()
    described: MeshesDescription | None = None  # of the scene's meshes

    @cached_property
    def model(self) -> SmplModel | None:
        """The user's body model, if one is given."""
        return read_smpl_model(self.chosen.body_model) if self.chosen.body_model else None

    def require_model(self, tool: str, family: str) -> SmplModel:
        """The body model of a family. Raises InputError where another one or none is given."""
        joints, where = MODELS[family]
        action = f"Give the {family} model file (.pkl or .npz, from {where}) with --body-model."
        if self.model is None:
            needed = f"{tool} stores pose and shape, which need the {family} body model"
            raise InputError(needed, "none", f"{action} {NEED_NO_MODEL}")
        found = len(self.model.parents)
        if found != joints:
            raise InputError(
                f"{tool} needs the {family} body model, which has {joints} joints",
                f"a model with {found} joints",
                f"Shapes and poses of other models mean something else. {action}",
            )
        return self.model

    def faces(self, tool: str, vertices: int) -> NDArray[np.int32]:
        """Faces for a tool's bodies, which bring none.

        From the file named for it or the body model. Raises InputError where neither fits.
        """
        found = self._given_faces()
        if found is None:
            where = MODELS["SMPL"][1]
            raise InputError(
                f"{tool} stores no faces; they come from a body model or from a mesh",
                "none",
                f"Give the SMPL model file (.pkl or .npz, from {where}) with --body-model, or any "
                "mesh of this topology (OBJ, PLY, GLB, meshes.npz) with --set meshes.faces=FILE.",
            )
        faces, count = found
        if count != vertices:
            raise InputError(
                f"the bodies of {tool} have {vertices} vertices; their faces must belong to as many",
                f"faces for {count} vertices",
                "Give the body model or the mesh that the estimate was made with.",
            )
        return faces

    def _given_faces(self) -> tuple[NDArray[np.int32], int] | None:
        if self.chosen.faces:
            return read_faces(self.chosen.faces)
        if self.model is not None:
            return self.model.faces.astype(np.int32), len(self.model.template)
        return None
