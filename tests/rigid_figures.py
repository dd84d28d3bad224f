"""Bodies whose motion is known in closed form, with everything that is measured from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import trimesh
from scipy.spatial.transform import Rotation

from mocoflow_core.body.rigid_controls import RigidControls, rigid_controls
from mocoflow_core.body.signed_distance import signed_distance_lattice
from mocoflow_core.fields.body_lattices import BodyMotionConfig, build_body_motion
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior

REACH_M = 0.08
MOTIONS = (
    (Rotation.identity(), np.array([0.0, 0.0, 0.0])),
    (Rotation.from_euler("z", 70, degrees=True), np.array([0.4, -0.3, 0.1])),
    (Rotation.from_euler("xyz", [150, 20, -60], degrees=True), np.array([-1.0, 0.5, 2.0])),
)


@dataclass(frozen=True, eq=False)
class Figure:
    """A canonical mesh, its controls and its look-up tables."""

    mesh: trimesh.Trimesh
    controls: RigidControls
    prior: SignedDistancePrior
    body: BodyMotion


def ellipsoid() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    mesh.vertices = mesh.vertices * [0.2, 0.12, 0.35]
    return mesh


def prior_of(mesh: trimesh.Trimesh) -> SignedDistancePrior:
    origin, lattice = signed_distance_lattice(
        np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32), 0.02, 0.2
    )
    return SignedDistancePrior(torch.from_numpy(lattice), torch.from_numpy(origin), 0.02)


def figure(mesh: trimesh.Trimesh, frames: list[np.ndarray]) -> Figure:
    """The mesh as canonical body, seen at the given vertices (V, 3) of each frame."""
    controls = rigid_controls(
        np.asarray(mesh.vertices, np.float32),
        np.stack(frames).astype(np.float32),
        np.asarray(mesh.faces, np.int32),
        np.linspace(0, 1, len(frames)),
        spacing=0.05,
        neighbours=16,
    )
    prior = prior_of(mesh)
    body = build_body_motion(controls, prior, REACH_M, BodyMotionConfig())
    return Figure(mesh, controls, prior, body)


def rigid_figure() -> Figure:
    """An ellipsoid that MOTIONS carries about."""
    mesh = ellipsoid()
    return figure(mesh, [rotation.apply(mesh.vertices) + shift for rotation, shift in MOTIONS])


def near_surface(mesh: trimesh.Trimesh, within_m: float, count: int = 400) -> np.ndarray:
    """Points (N, 3) at random distances up to ``within_m`` on both sides of the surface."""
    rng = np.random.default_rng(0)
    chosen = rng.integers(len(mesh.vertices), size=count)
    offset = rng.uniform(-within_m, within_m, size=(count, 1))
    return mesh.vertices[chosen] + offset * mesh.vertex_normals[chosen]


def rows(count: int, row: int) -> torch.Tensor:
    return torch.full((count,), row, dtype=torch.int64)


def single(points: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.asarray(points, np.float32))
