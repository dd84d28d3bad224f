"""Motions of AIST++: ``motions/<sequence>.pkl``, SMPL poses in a world of centimetres.

Layout and reconstruction: google/aistplusplus_api, aist_plusplus/loader.py; every dancer has the
male model's mean shape.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, read_stored
from mocoflow_core.progress import Progress, untold

TOOL = "AIST++ motion"
PARTS = {"smpl_poses", "smpl_trans", "smpl_scaling"}
METRES = 0.01


@dataclass(frozen=True, eq=False)
class Motion:
    """A dancer's poses on the 60 Hz grid, as they are stored: world centimetres."""

    poses: NDArray[np.float64]  # (N, 24, 3) axis-angle, the first global
    translations_cm: NDArray[np.float64]  # (N, 3)
    scaling: float  # of the posed model, to centimetres

    def __len__(self) -> int:
        return len(self.poses)


def read_motion(path: Path) -> Motion:
    """Read ``motions/<sequence>.pkl``. Raises InputError for anything else."""
    return _motion(read_stored(path), path.name)


def motion_vertices(
    motion: Motion,
    model: SmplModel,
    rows: NDArray[np.integer] | None = None,
    progress: Progress = untold,
) -> NDArray[np.float32]:
    """Bodies (T, V, 3) in world **metres**, at true scale: the world divided by 100.

    ``scaling`` multiplies the posed body, pelvis offset included, before the translation.

    Args:
        model: SMPL, male.
        rows: of the motion; all of them where not given.
    """
    chosen = np.arange(len(motion)) if rows is None else rows
    bodies = posed_vertices(model, motion.poses[chosen], np.zeros(1), progress=progress)
    placed_cm = motion.scaling * bodies + motion.translations_cm[chosen, None]
    return (METRES * placed_cm).astype(np.float32)


def recognises(stored: EstimateFile) -> bool:
    """A dictionary with poses, translations and a scaling."""
    return isinstance(stored.content, Mapping) and set(stored.content) >= PARTS


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """The dancer in the world of the cameras' files, metres. Raises InputError without SMPL."""
    motion = _motion(stored.content, stored.path.name)
    model = context.require_model(TOOL, "SMPL")
    return BodyEstimate(
        source=TOOL,
        frame_indices=np.arange(len(motion), dtype=np.int32),
        numbering="position",
        vertices=motion_vertices(motion, model, progress=context.progress),
        faces=model.faces.astype(np.int32),
        coordinates="world",
        located=True,
        remarks=("bodies stand in AIST++'s world divided by 100; it takes the male SMPL model",),
    )


def _motion(content: object, name: str) -> Motion:
    if not isinstance(content, Mapping) or not set(content) >= PARTS:
        found = ", ".join(map(str, content)) if isinstance(content, Mapping) else "no dictionary"
        raise InputError(
            f"a motion of AIST++ with {', '.join(sorted(PARTS))}",
            f"{found} in {name}",
            "Give a file of the motions folder.",
        )
    poses = np.asarray(content["smpl_poses"], np.float64)
    translations = np.asarray(content["smpl_trans"], np.float64)
    scaling = np.asarray(content["smpl_scaling"], np.float64)
    count = len(np.atleast_1d(translations))
    if poses.size != 72 * count or translations.shape != (count, 3) or scaling.size != 1:
        raise InputError(
            "a motion with poses (N, 72) or (N, 24, 3), translations (N, 3) and one scaling",
            f"{poses.shape}, {translations.shape} and {scaling.shape} in {name}",
            "Download the file again.",
        )
    return Motion(poses.reshape(count, 24, 3), translations, float(scaling.ravel()[0]))
