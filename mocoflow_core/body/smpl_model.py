"""A body model of SMPL's kind: a template that shape and pose deform, and a skeleton within."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class SmplModel:
    """Arrays of one model, in metres and in the model's own axes (SMPL: y up, x to its left).

    The same record serves SMPL (24 joints), SMPL-H (52) and SMPL-X (55).
    Source: Loper et al., SMPL (2015), sec. 3; Pavlakos et al., SMPL-X (2019), sec. 3.1.
    """

    template: NDArray[np.floating]  # (V, 3) metres
    faces: NDArray[np.int32]  # (F, 3)
    shape_directions: NDArray[np.floating]  # (V, 3, S) metres per unit of shape
    pose_directions: NDArray[
        np.floating
    ]  # (V, 3, 9 (J - 1)), of R - I of the joints after the root
    joint_regressor: NDArray[np.floating]  # (J, V), rows sum to one
    skinning_weights: NDArray[np.floating]  # (V, J), rows sum to one
    parents: NDArray[np.int32]  # (J,), -1 for the root, which is joint 0

    @property
    def vertex_count(self) -> int:
        return len(self.template)

    @property
    def joint_count(self) -> int:
        return len(self.parents)

    @property
    def shape_count(self) -> int:
        """How many shape coefficients the model knows; fewer may be given."""
        return self.shape_directions.shape[2]
