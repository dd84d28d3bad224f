"""The motion of a mesh as rigid transforms of a few hundred control points on its surface.

Each control point carries, for each frame, the rotation and the position that its neighbourhood
took from the canonical mesh (local Procrustes). Everything between control points and between
frames is blended from them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from mocoflow_core.geometry.nearest_rotation import rotation_by_svd

Array = NDArray[np.float32]

# Pulls rotations that a neighbourhood does not determine (flat, line-like or tiny ones) towards
# the rotation of the whole body; relative to the neighbourhood's own extent, so free of units.
_GLOBAL_PULL = 1e-3
# Sum of squares (m^2) below which a neighbourhood is one point and its shape is rounding.
_ONE_POINT = 1e-8

_FILE = "controls.safetensors"
_PARTS = ("times", "canonical", "observed", "rotations", "surface", "surface_control", "ever_apart")


@dataclass(frozen=True, eq=False)
class RigidControls:
    """Control points with their rigid motion; canonical and observed space are world metres.

    A canonical point p near control k is observed at ``R_k (p - canonical_k) + observed_k``.
    """

    times: NDArray[np.float64]  # (T,) normalised, ascending
    canonical: Array  # (K, 3)
    observed: Array  # (T, K, 3)
    rotations: Array  # (T, K, 3, 3) canonical -> observed
    surface: Array  # (S, 3) dense points of the canonical surface
    surface_control: NDArray[np.int64]  # (S,) nearest control of each surface point
    ever_apart: Array  # (K, K) largest distance that two controls ever have, metres

    def frames(self, rows: NDArray[np.int64]) -> RigidControls:
        """Only the given frames."""
        return replace(
            self,
            times=self.times[rows],
            observed=self.observed[rows],
            rotations=self.rotations[rows],
        )

    def surface_at(self, row: int) -> Array:
        """The dense surface points carried to one frame, (S, 3)."""
        k = self.surface_control
        moved = np.einsum("sij,sj->si", self.rotations[row, k], self.surface - self.canonical[k])
        return (moved + self.observed[row, k]).astype(np.float32)

    def at_time(self, time: float) -> RigidControls:
        """The controls at one moment, interpolated between frames.

        The body's own rigid motion is interpolated first (rotation on the manifold), then what
        each control does relative to it, so that a spinning body does not shrink between frames.
        """
        clamped = float(np.clip(time, self.times[0], self.times[-1]))
        after = int(np.clip(np.searchsorted(self.times, clamped), 1, max(len(self.times) - 1, 1)))
        if len(self.times) == 1 or clamped in self.times:
            row = int(np.abs(self.times - clamped).argmin())
            return self._one_frame(clamped, self.observed[row], self.rotations[row])
        before = after - 1
        share = (clamped - self.times[before]) / (self.times[after] - self.times[before])
        observed, rotations = _interpolate(
            self.canonical,
            (self.observed[before], self.rotations[before]),
            (self.observed[after], self.rotations[after]),
            share,
        )
        return self._one_frame(clamped, observed, rotations)

    def at_times(self, times: NDArray[np.float64]) -> RigidControls:
        """The controls at several moments, each as ``at_time`` gives it."""
        moments = [self.at_time(float(time)) for time in times]
        return replace(
            self,
            times=np.concatenate([moment.times for moment in moments]),
            observed=np.concatenate([moment.observed for moment in moments]),
            rotations=np.concatenate([moment.rotations for moment in moments]),
        )

    def _one_frame(self, time: float, observed: Array, rotations: Array) -> RigidControls:
        return replace(
            self, times=np.array([time]), observed=observed[None], rotations=rotations[None]
        )

    def save(self, folder: Path) -> None:
        """Write ``controls.safetensors``."""
        parts = {name: np.ascontiguousarray(getattr(self, name)) for name in _PARTS}
        save_file(parts, folder / _FILE)

    @classmethod
    def load(cls, folder: Path) -> RigidControls:
        return cls(**load_file(folder / _FILE))


def rigid_controls(
    canonical_vertices: Array,
    vertices: Array,
    faces: NDArray[np.int32],
    times: NDArray[np.float64],
    spacing: float,
    neighbours: int,
) -> RigidControls:
    """Measure the rigid motion of control points by local Procrustes.

    Args:
        canonical_vertices: (V, 3) world metres.
        vertices: (T, V, 3) world metres.
        faces: (F, 3).
        times: (T,) normalised.
        spacing: about one control for each cube of this edge, metres.
        neighbours: vertices in the neighbourhood of a control.

    Source: method notes, fast representation (body prior); the paper's sec. 5 names the idea.
    """
    chosen = _thin(canonical_vertices, spacing)
    largest = float(np.linalg.norm(np.ptp(canonical_vertices, axis=0)))
    neighbourhood = _neighbourhoods(canonical_vertices, vertices, chosen, neighbours, largest)
    local = canonical_vertices[neighbourhood]  # (K, N, 3)
    centre = local.mean(1)
    observed = np.empty((len(vertices), len(chosen), 3), np.float32)
    rotations = np.empty((len(vertices), len(chosen), 3, 3), np.float32)
    for row, frame in enumerate(vertices):
        whole = best_rotation(
            canonical_vertices - canonical_vertices.mean(0), frame - frame.mean(0)
        )
        moved = frame[neighbourhood]
        moved_centre = moved.mean(1)
        rotations[row] = best_rotation(
            local - centre[:, None], moved - moved_centre[:, None], whole
        )
        observed[row] = moved_centre
    surface = np.concatenate([canonical_vertices, canonical_vertices[faces].mean(1)])
    _, surface_control = cKDTree(centre).query(surface)
    return RigidControls(
        np.asarray(times, np.float64),
        centre.astype(np.float32),
        observed,
        rotations,
        surface.astype(np.float32),
        surface_control.astype(np.int64),
        _ever_apart(centre.astype(np.float32), observed),
    )


def best_rotation(source: Array, target: Array, fallback: Array | None = None) -> Array:
    """Rotations that carry centred point sets onto each other (Kabsch), never reflections.

    Args:
        source, target: (..., N, 3), centred.
        fallback: (3, 3) rotation taken where the points do not determine one.

    Returns:
        (..., 3, 3).
    """
    covariance = np.swapaxes(target, -1, -2) @ source
    if fallback is not None:
        extent = (source * source).sum((-1, -2))[..., None, None]
        covariance = covariance + _GLOBAL_PULL * np.maximum(extent, _ONE_POINT) * fallback
    return rotation_by_svd(covariance).astype(np.float32)


def _thin(points: Array, spacing: float) -> NDArray[np.int64]:
    """One point for each occupied cube of the given edge: the one nearest to the cube's mean."""
    cube = np.floor((points - points.min(0)) / spacing).astype(np.int64)
    _, label = np.unique(cube, axis=0, return_inverse=True)
    label = label.reshape(-1)
    count = np.bincount(label)
    mean = np.stack([np.bincount(label, points[:, a]) / count for a in range(3)], -1)
    order = np.lexsort((np.linalg.norm(points - mean[label], axis=1), label))
    first = np.unique(label[order], return_index=True)[1]
    return order[first]


def _neighbourhoods(
    canonical: Array, vertices: Array, chosen: NDArray[np.int64], count: int, largest: float
) -> NDArray[np.int64]:
    """(K, count) vertices around each control that stay near it in every frame.

    A vertex that leaves (a hand that touches the hip in the canonical frame) is replaced by the
    control's own vertex.
    """
    distance, near = cKDTree(canonical).query(canonical[chosen], k=min(count, len(canonical)))
    reach = np.maximum(2.0 * distance[:, -1:], 0.02 * largest)
    keep = np.ones(near.shape, bool)
    for frame in vertices:
        apart = np.linalg.norm(frame[near] - frame[chosen][:, None], axis=-1)
        keep &= apart < reach
    return np.where(keep, near, chosen[:, None])


def _interpolate(
    canonical: Array, before: tuple[Array, Array], after: tuple[Array, Array], share: float
) -> tuple[Array, Array]:
    centred = canonical - canonical.mean(0)
    middles, wholes, positions, locals_ = [], [], [], []
    for observed, rotations in (before, after):
        middle = observed.mean(0)
        whole = best_rotation(centred, observed - middle)
        middles.append(middle)
        wholes.append(whole)
        positions.append((observed - middle) @ whole)
        locals_.append(whole.T @ rotations)
    whole = _slerp(wholes[0][None], wholes[1][None], share)[0]
    position = (1.0 - share) * positions[0] + share * positions[1]
    observed = position @ whole.T + (1.0 - share) * middles[0] + share * middles[1]
    rotations = whole @ _slerp(locals_[0], locals_[1], share)
    return observed.astype(np.float32), rotations.astype(np.float32)


def _slerp(before: Array, after: Array, share: float) -> Array:
    start = Rotation.from_matrix(before)
    step = (start.inv() * Rotation.from_matrix(after)).as_rotvec()
    return (start * Rotation.from_rotvec(share * step)).as_matrix().astype(np.float32)


def _ever_apart(canonical: Array, observed: Array) -> Array:
    """Over the canonical mesh and all frames, never over one moment alone.

    Controls that touch in one frame only are told apart from true neighbours by it.
    """
    largest = _pairwise(canonical)
    for frame in observed:
        np.maximum(largest, _pairwise(frame), out=largest)
    return largest


def _pairwise(points: Array) -> Array:
    squared = (points * points).sum(-1)
    product = points @ points.T
    return np.sqrt(np.maximum(squared[:, None] + squared[None] - 2.0 * product, 0.0))
