"""The part of the motion that the body mesh already knows: a look-up in both directions.

For each frame, the rigid motion of the mesh's control points is blended onto lattice nodes around
the body: in observed space for ``to_canonical``, in canonical space for ``to_observed``. A query
is one trilinear look-up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial import cKDTree
from torch import Tensor
from torch.nn.functional import embedding_bag, normalize

from mocoflow_core.body.rigid_controls import RigidControls
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior
from mocoflow_core.geometry.grid import Corners, SparseGrids

Array = NDArray[np.float32]


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


class BodyMotion:
    """Motion of the body mesh between canonical and observed space, world metres.

    Rows of the tables are affine maps (4, 3): ``mapped = [x, 1] @ row``.
    """

    def __init__(
        self,
        times: Tensor,
        observed_grids: SparseGrids,
        observed_maps: Tensor,
        observed_distance: Tensor,
        observed_facing: Tensor,
        canonical_grid: SparseGrids,
        canonical_maps: Tensor,
    ) -> None:
        self.times = times  # (T,) float64
        self.observed_grids = observed_grids  # one grid per frame
        self.observed_maps = observed_maps  # (N, 4, 3) to canonical
        self.observed_distance = observed_distance  # (N,) metres from the mesh, negative inside
        self.observed_facing = observed_facing  # (N, 3) unit normals of the nearest surface
        self.canonical_grid = canonical_grid  # one grid
        self.canonical_maps = canonical_maps  # (T, M, 4, 3) to observed
        self._near: dict[float, Tensor] = {}

    def to(self, device: torch.device) -> BodyMotion:
        return BodyMotion(
            self.times.to(device),
            self.observed_grids.to(device),
            self.observed_maps.to(device),
            self.observed_distance.to(device),
            self.observed_facing.to(device),
            self.canonical_grid.to(device),
            self.canonical_maps.to(device),
        )

    def near_body(self, points: Tensor, frame: Tensor, within_m: float) -> Tensor:
        """Cheap test of observed points (P, 3) of frame rows (P,): may they lie near the mesh?

        True for every point closer than ``within_m``, and for few that are farther.
        """
        return self._may_be_near(within_m)[self.observed_grids.flat_nearest(points, frame)]

    def _may_be_near(self, within_m: float) -> Tensor:
        """For each lattice point of all frames: may a point next to it be ``within_m`` near?"""
        if within_m not in self._near:
            half_cell = 0.5 * 3.0**0.5 * self.observed_grids.spacing
            numbers = self.observed_grids.node_map
            distance = self.observed_distance[numbers.clamp_min(0).long()]
            self._near[within_m] = (numbers >= 0) & (distance < within_m + half_cell)
        return self._near[within_m]

    def shell_nodes(self, row: int, within_m: float) -> tuple[NDArray[np.float64], float]:
        """Positions (N, 3) of one frame's lattice points next to the shell, and the spacing."""
        grids = self.observed_grids
        start, shape = int(grids.offset[row]), tuple(grids.shape[row].tolist())
        near = self._may_be_near(within_m)[start : start + int(np.prod(shape))]
        place = np.stack(np.unravel_index(np.flatnonzero(near.cpu().numpy()), shape), -1)
        return grids.origin[row].double().cpu().numpy() + grids.spacing * place, grids.spacing

    def distance(self, corners: Corners) -> Tensor:
        """Signed distance (P,) from the frame's mesh; infinite where no node is near."""
        numbers, weights = corners
        weights = weights.detach()
        found = (self.observed_distance[numbers] * weights).sum(-1)
        return torch.where(weights.sum(-1) > 0, found, torch.inf)

    def facing(self, corners: Corners) -> Tensor:
        """Unit normals (P, 3) of the surface near observed points."""
        numbers, weights = corners
        blended = embedding_bag(
            numbers, self.observed_facing, per_sample_weights=weights.detach(), mode="sum"
        )
        return normalize(blended, dim=-1)

    def to_canonical(
        self, points: Tensor, frame: Tensor, corners: Corners | None = None
    ) -> tuple[Tensor, Tensor]:
        """Observed points (P, 3) to canonical space; and whether a node is near.

        A point that no node is near stays where it is. ``corners`` saves the look-up where the
        caller has made it already.
        """
        numbers, weights = corners or self.observed_grids.corners(points, frame)
        known = weights.detach().sum(-1) > 0
        mapped = _blend(self.observed_maps[numbers], weights, points, self._apart)
        return torch.where(known[:, None], mapped, points), known

    def to_observed(self, points: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """Canonical points to the observed space of their frames; and whether a node is near."""
        numbers, weights = self.canonical_grid.corners(points, torch.zeros_like(frame))
        known = weights.detach().sum(-1) > 0
        maps = self.canonical_maps[frame[:, None], numbers]
        mapped = _blend(maps, weights, points, self._apart)
        return torch.where(known[:, None], mapped, points), known

    @property
    def _apart(self) -> float:
        return self.canonical_grid.spacing

    def tensors(self) -> dict[str, Tensor]:
        """All content as named tensors, for saving."""
        named = {
            "times": self.times,
            "observed_maps": self.observed_maps,
            "observed_distance": self.observed_distance,
            "observed_facing": self.observed_facing,
            "canonical_maps": self.canonical_maps,
        }
        grids = {"observed": self.observed_grids, "canonical": self.canonical_grid}
        for prefix, grid in grids.items():
            named |= {f"{prefix}_grid.{name}": part for name, part in grid.tensors().items()}
        return {name: part.contiguous() for name, part in named.items()}

    @classmethod
    def from_tensors(cls, named: dict[str, Tensor]) -> BodyMotion:
        def grids(prefix: str) -> SparseGrids:
            start = f"{prefix}_grid."
            return SparseGrids.from_tensors(
                {name[len(start) :]: part for name, part in named.items() if name.startswith(start)}
            )

        return cls(
            named["times"],
            grids("observed"),
            named["observed_maps"],
            named["observed_distance"],
            named["observed_facing"],
            grids("canonical"),
            named["canonical_maps"],
        )


def _blend(maps: Tensor, weights: Tensor, points: Tensor, apart: float) -> Tensor:
    """Apply the maps (P, 8, 4, 3) of the corners to points (P, 3) and average what agrees.

    Corners that carry the point farther than ``apart`` from where the heaviest corner carries it
    belong to another limb; a point between two limbs goes with the nearer one, never half-way.
    """
    x, y, z = points[:, None, :, None].unbind(2)
    mapped = torch.addcmul(maps[:, :, 3], maps[:, :, 0], x)
    mapped = torch.addcmul(torch.addcmul(mapped, maps[:, :, 1], y), maps[:, :, 2], z)
    heaviest = weights.detach().argmax(-1)
    reference = mapped.detach()[torch.arange(len(points), device=points.device), heaviest]
    agrees = ((mapped.detach() - reference[:, None]) ** 2).sum(-1) < apart**2
    agreeing = weights * agrees
    total = agreeing.sum(-1, keepdim=True).clamp_min(torch.finfo(weights.dtype).tiny)
    return (mapped * (agreeing / total)[..., None]).sum(1)


Lattice = tuple[Array, NDArray[np.int64], NDArray[np.bool_]]  # origin, shape, occupied
Blending = tuple[NDArray[np.int64], Array]  # controls near each node (N, K), their weights (N, K)


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
    blended = _nearest_rotation(np.einsum("nk,nkij->nij", weights, rotations[near]))
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


def _nearest_rotation(matrices: Array) -> Array:
    """The rotation nearest to each blended matrix (..., 3, 3), by the polar decomposition."""
    u, _, vt = np.linalg.svd(matrices.astype(np.float64))
    handed = np.ones(u.shape[:-1])
    handed[..., -1] = np.sign(np.linalg.det(u @ vt))
    return (u * handed[..., None, :]) @ vt


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
