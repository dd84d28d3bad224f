"""A body of one shape that can be posed: vertices, keypoints and the labels that clothes need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from anny import Anny, KeypointsRegressor
from anny.face_segmentation import get_face_segmentation_mask
from numpy.typing import NDArray

from mocoflow_core.synthetic.anny_model import load_anny
from mocoflow_core.synthetic.body_shape import BodyShape
from mocoflow_core.synthetic.motions import Motion

# The visible skin; cavities behind eyes and lips are no surface that a camera can see.
_OUTER_PARTS = [
    *("body", "head", "hand.L", "hand.R", "foot.L", "foot.R", "eye_front.L", "eye_front.R")
]

# Limb -> prefixes of the bones that move it; what matches none belongs to the torso.
LIMBS = (
    "torso",
    "head",
    "arm.L",
    "arm.R",
    "hand.L",
    "hand.R",
    "leg.L",
    "leg.R",
    "foot.L",
    "foot.R",
)
_LIMB_PREFIXES = {
    "head": ("neck02", "neck03", "head", "eye"),
    "arm": ("shoulder01", "upperarm", "lowerarm"),
    "hand": ("wrist", "finger", "metacarpal"),
    "leg": ("upperleg", "lowerleg"),
    "foot": ("foot", "toe"),
}

_FRAMES_AT_ONCE = 16  # Bounds the memory of skinning: 16 frames x 13500 vertices x 12 floats.


@dataclass(frozen=True, eq=False)
class Person:
    """Anny in one body shape. Rest pose: +z up, faces -y, left at +x, metres."""

    anny: Anny
    shape: BodyShape

    @classmethod
    def load(cls, shape: BodyShape) -> Person:
        return cls(load_anny(shape), shape)

    @cached_property
    def rest_vertices(self) -> NDArray[np.float64]:
        """(V, 3) in the rest pose, the coordinates in which clothes are defined."""
        return self._rest["vertices"][0].numpy()

    @cached_property
    def _rest(self) -> dict[str, torch.Tensor]:
        with torch.no_grad():
            return self.anny(phenotype_kwargs=self.shape.model_dump())

    @cached_property
    def outer_faces(self) -> NDArray[np.int32]:
        """(F, 3) triangles that can be seen from outside."""
        keep = get_face_segmentation_mask(self.anny.to_model_data(), _OUTER_PARTS)
        return self.anny.faces[keep].numpy().astype(np.int32)

    @cached_property
    def keypoint_regressor(self) -> NDArray[np.float64]:
        """(17, V) COCO keypoints from vertices, rows sum to one."""
        return KeypointsRegressor.coco(self.anny).regression_weights[:17].numpy()

    @cached_property
    def limb_weights(self) -> NDArray[np.float64]:
        """(V, len(LIMBS)) how much each limb's bones move a vertex, rows sum to one."""
        weights = np.zeros((len(self.rest_vertices), len(LIMBS)))
        for bone, column in zip(
            self.anny.bone_labels, self.anny.dense_vertex_bone_weights.numpy().T, strict=True
        ):
            weights[:, LIMBS.index(_limb_of(bone))] += column
        return weights

    def bone_head(self, bone: str) -> NDArray[np.float64]:
        """Rest position of a bone's joint, (3,)."""
        return self._rest["bone_poses"][0, self.anny.bone_labels.index(bone), :3, 3].numpy()

    def pose(self, motion: Motion) -> NDArray[np.float64]:
        """Vertices (T, V, 3) in world metres, the root joint where the motion puts it."""
        root = self.bone_head("root")
        posed = np.concatenate(
            [
                self._skin(motion, slice(first, first + _FRAMES_AT_ONCE))
                for first in range(0, len(motion), _FRAMES_AT_ONCE)
            ]
        )
        turned = np.einsum("tij,tvj->tvi", motion.root_rotation.as_matrix(), posed - root)
        return turned + motion.root_position[:, None]

    def _skin(self, motion: Motion, frames: slice) -> NDArray[np.float64]:
        count = len(range(len(motion))[frames])
        pose = torch.eye(4, dtype=torch.float64).repeat(count, self.anny.bone_count, 1, 1)
        for bone, rotations in motion.joints.items():
            matrices = torch.from_numpy(rotations[frames].as_matrix())
            pose[:, self.anny.bone_labels.index(bone), :3, :3] = matrices
        with torch.no_grad():
            posed = self.anny(pose_parameters=pose, phenotype_kwargs=self.shape.model_dump())
        return posed["vertices"].numpy()


def _limb_of(bone: str) -> str:
    side = bone[-2:] if bone[-2:] in (".L", ".R") else ""
    for limb, prefixes in _LIMB_PREFIXES.items():
        if bone.startswith(prefixes):
            return limb if limb == "head" else limb + side
    return "torso"
