"""Lattices around the body, and the rigid motion of its control points blended onto them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial import cKDTree
from torch import Tensor

from mocoflow_core.body.rigid_controls import RigidControls
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior
from mocoflow_core.geometry.grid import SparseGrids
from mocoflow_core.geometry.nearest_rotation import nearest_rotation
from mocoflow_core.progress import Progress, untold

Array = NDArray[np.float32]

Lattice = tuple[Array, NDArray[np.int64], NDArray[np.bool_]]  # origin, shape, occupied
Blending = tuple[NDArray[np.int64], Array]  # controls near each node (N, K), their weights (N, K)


class BodyMotionConfig(ConfigurationPart):
    """How the mesh's motion is spread into the space around it."""

    control_spacing_m: float = Field(0.03, gt=0, description="about one control per cube")
    neighbours: int = Field(24, ge=3, description="vertices in a control's neighbourhood")
    node_spacing_m: float = Field(0.04, gt=0, description="lattice spacing of the look-up")
    blend_count: int = Field(8, ge=1, description="controls blended at a node")
    blend_width_m: float = Field(0.03, gt=0, description="standard deviation of the blending")
    stay_within_m: float = Field(
        0.15, gt=0, description="controls that ever part farther are not blended (limbs in contact)"
    )


@dataclass(frozen=True, eq=False)
class CanonicalNodes:
    """The lattice around the canonical body."""

    nodes: Array  # (M, 3)
    lattice: Lattice
    blending: Blending


def build_body_motion(
    controls: RigidControls,
    prior: SignedDistancePrior,
    reach: float,
    configuration: BodyMotionConfig,
    canonical: CanonicalNodes | None = None,
    progress: Progress = untold,
) -> BodyMotion:
    """Blend the controls' rigid motion onto lattices around the body.

    Args:
        controls: the mesh's motion; every one of its frames gets a lattice.
        prior: the canonical mesh, for the side and the direction of surfaces.
        reach: how far from the mesh points will be asked for, metres.
        canonical: ``canonical_nodes`` of the same controls, where the caller keeps them.
    """
    spacing = configuration.node_spacing_m
    node_reach = _node_reach(reach, configuration)
    canonical = canonical or canonical_nodes(controls, reach, configuration)
    lattices, maps, distances, facing = [], [], [], []
    for row in range(len(controls.times)):
        nodes, lattice, distance = _nodes_near(controls.surface_at(row), spacing, node_reach)
        inverse = np.swapaxes(controls.rotations[row], -1, -2)
        source, target = controls.observed[row], controls.canonical
        blending = _blending(nodes, source, controls.ever_apart, configuration)
        lattices.append(lattice)
        distances.append(distance)
        maps.append(_node_maps(nodes, source, target, inverse, blending))
        inside, normals = _side_and_normals(nodes, maps[-1], prior)
        distances[-1][inside] *= -1.0
        facing.append(normals)
        progress((row + 1) / len(controls.times), f"body motion of frame {row + 1}")
    canonical_maps = [
        _node_maps(canonical.nodes, controls.canonical, observed, rotations, canonical.blending)
        for observed, rotations in zip(controls.observed, controls.rotations, strict=True)
    ]
    return BodyMotion(
        torch.from_numpy(controls.times),
        _pack(lattices, spacing),
        torch.from_numpy(np.concatenate(maps)),
        torch.from_numpy(np.concatenate(distances)),
        torch.cat(facing),
        _pack([canonical.lattice], spacing),
        torch.from_numpy(np.stack(canonical_maps)),
    )


def canonical_nodes(
    controls: RigidControls, reach: float, configuration: BodyMotionConfig
) -> CanonicalNodes:
    """The canonical lattice and its blending, which are the same at every moment."""
    node_reach = _node_reach(reach, configuration)
    nodes, lattice, _ = _nodes_near(controls.surface, configuration.node_spacing_m, node_reach)
    blending = _blending(nodes, controls.canonical, controls.ever_apart, configuration)
    return CanonicalNodes(nodes, lattice, blending)


def _node_reach(reach: float, configuration: BodyMotionConfig) -> float:
    """A point within reach must find all eight corners of its cell."""
    return float(reach + configuration.node_spacing_m * np.sqrt(3.0))


def _nodes_near(surface: Array, spacing: float, reach: float) -> tuple[Array, Lattice, Array]:
    """Lattice points within ``reach`` of surface points: positions, lattice, distances."""
    origin = surface.min(0) - reach
    shape = np.ceil((np.ptp(surface, axis=0) + 2 * reach) / spacing).astype(np.int64) + 1
    index = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), -1)
    positions = (origin + spacing * index.reshape(-1, 3)).astype(np.float32)
    distance, _ = cKDTree(surface).query(positions, distance_upper_bound=reach)
    occupied = np.isfinite(distance)
    lattice = (origin.astype(np.float32), shape, occupied)
    return positions[occupied], lattice, distance[occupied].astype(np.float32)


def _blending(
    nodes: Array, source: Array, ever_apart: Array, configuration: BodyMotionConfig
) -> Blending:
    """The controls (K, 3) that carry each node (N, 3), and with which weights."""
    count = min(configuration.blend_count, len(source))
    distance, near = cKDTree(source).query(nodes, k=count)
    distance, near = distance.reshape(-1, count), near.reshape(-1, count)
    excess = distance**2 - distance[:, :1] ** 2
    weights = np.exp(-excess / (2.0 * configuration.blend_width_m**2))
    weights *= ever_apart[near[:, :1], near] < configuration.stay_within_m
    return near, (weights / weights.sum(1, keepdims=True)).astype(np.float32)


def _node_maps(
    nodes: Array, source: Array, target: Array, rotations: Array, blending: Blending
) -> Array:
    """Affine maps (N, 4, 3) of nodes from the rigid motion of the controls near them."""
    near, weights = blending
    blended = nearest_rotation(np.einsum("nk,nkij->nij", weights, rotations[near]))
    moved = np.einsum("nkij,nkj->nki", rotations[near], nodes[:, None] - source[near])
    mapped = np.einsum("nk,nki->ni", weights, moved + target[near])
    shift = mapped - np.einsum("nij,nj->ni", blended, nodes)
    return np.concatenate([np.swapaxes(blended, -1, -2), shift[:, None]], 1).astype(np.float32)


def _side_and_normals(
    nodes: Array, maps: Array, prior: SignedDistancePrior
) -> tuple[NDArray[np.bool_], Tensor]:
    """Which nodes lie inside the body (N,), and its normals turned to observed space (N, 3)."""
    turn = torch.from_numpy(maps[:, :3])
    mapped = (torch.from_numpy(nodes)[:, None] @ turn)[:, 0] + torch.from_numpy(maps[:, 3])
    normals = (turn @ prior.normals(mapped)[..., None])[..., 0]
    return (prior(mapped) < 0).numpy(), normals


def _pack(lattices: list[Lattice], spacing: float) -> SparseGrids:
    """Number the occupied points of all lattices consecutively."""
    node_maps, offsets, start, offset = [], [], 0, 0
    for _, _, occupied in lattices:
        numbers = np.full(len(occupied), -1, np.int32)
        numbers[occupied] = start + np.arange(occupied.sum(), dtype=np.int32)
        node_maps.append(numbers)
        offsets.append(offset)
        start, offset = start + int(occupied.sum()), offset + len(occupied)
    return SparseGrids(
        torch.from_numpy(np.stack([origin for origin, _, _ in lattices])),
        torch.from_numpy(np.stack([shape for _, shape, _ in lattices])),
        torch.tensor(offsets, dtype=torch.int64),
        torch.from_numpy(np.concatenate(node_maps)),
        float(spacing),
    )
