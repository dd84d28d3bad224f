"""Bodies in closed form: a torso with one arm, and what can be done to them."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Body = NDArray[np.float32]  # (V, 3) metres

SHOULDER = np.array([0.18, 0.0, 0.25])
_RINGS = [8, 12]


@cache
def _parts() -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    torso = trimesh.creation.capsule(height=0.5, radius=0.15, count=_RINGS)
    arm = trimesh.creation.capsule(height=0.45, radius=0.05, count=_RINGS)
    arm.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    arm.apply_translation(SHOULDER + np.array([0.24, 0.0, 0.0]))
    return torso, arm


TORSO = slice(0, len(_parts()[0].vertices))
ARM = slice(len(_parts()[0].vertices), None)


def torso_and_arm() -> tuple[Body, NDArray[np.int32]]:
    """Vertices (V, 3) and faces (F, 3): an arm stretched out along x from a torso along z."""
    torso, arm = _parts()
    vertices = np.concatenate([torso.vertices, arm.vertices])
    faces = np.concatenate([torso.faces, len(torso.vertices) + arm.faces])
    return vertices.astype(np.float32), faces.astype(np.int32)


def turned(body: Body, degrees: float) -> Body:
    """The whole body turned about an oblique axis and moved."""
    rotation = Rotation.from_rotvec(np.radians(degrees) * np.array([2.0, -3.0, 6.0]) / 7.0)
    return (rotation.apply(body) + np.array([0.4, -0.3, 0.1])).astype(np.float32)


def swung(body: Body, degrees: float) -> Body:
    """The arm swung about the shoulder in the plane of x and z; positive is downwards."""
    result = body.copy()
    rotation = Rotation.from_euler("y", degrees, degrees=True)
    result[ARM] = rotation.apply(body[ARM] - SHOULDER) + SHOULDER
    return result
