"""The part of the motion that the body mesh already knows: a look-up in both directions.

For each frame, the rigid motion of the mesh's control points is blended onto lattice nodes around
the body: in observed space for ``to_canonical``, in canonical space for ``to_observed``. A query
is one trilinear look-up.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import embedding_bag, normalize

from mocoflow_core.geometry.grid import Corners, SparseGrids

Array = NDArray[np.float32]


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

    def at_times(self, times: Tensor) -> BodyMotion:
        """The only moment of a body that stands still, at each of ``times`` (T,).

        The tables are shared, not copied.
        """
        return BodyMotion(
            times,
            self.observed_grids.shared_by(len(times)),
            self.observed_maps,
            self.observed_distance,
            self.observed_facing,
            self.canonical_grid,
            self.canonical_maps.expand(len(times), -1, -1, -1),
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
