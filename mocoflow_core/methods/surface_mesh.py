"""The canonical surface of a trained scene as a coloured triangle mesh, by marching cubes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components
from skimage.measure import marching_cubes

from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.errors import InputError
from mocoflow_core.rendering.canonical_scene import CanonicalScene

Points = NDArray[np.float64]

LEAST_AREA_SHARE = 0.01  # of the whole surface; a smaller part floats beside the body
MOST_LATTICE_POINTS = 50_000_000  # bounds the memory
_COARSE = 2  # lattice points from one of the first look to the next
_HALVINGS = 6  # of a lattice edge, until its vertex is placed
_AT_ONCE = 65_536


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A closed surface in canonical space, faces winding outward."""

    vertices: Points  # (V, 3) world metres
    faces: NDArray[np.int32]  # (F, 3)
    colours: NDArray[np.float32]  # (V, 3) sRGB-encoded in [0, 1]
    floating: int  # parts that were left out


class _Lattice(NamedTuple):
    origin: Points  # (3,) metres
    spacing_m: float
    shape: tuple[int, ...]

    def at(self, places: NDArray) -> Points:
        """Positions (N, 3) of lattice coordinates (N, 3)."""
        return self.origin + self.spacing_m * places


@torch.no_grad()
def surface_mesh(scene: CanonicalScene, spacing_m: float) -> SurfaceMesh:
    """Where the density passes ``scene.surface_density``, to a hundredth of the spacing.

    What is enclosed cannot be seen and is filled. Parts with less than 1 % of the surface are left
    out.

    Args:
        spacing_m: of the lattice; what is thinner may be lost.

    Raises:
        InputError: the density nowhere reaches the level, or the lattice has too many points.
    """
    lattice = _lattice(scene, spacing_m)
    # A border of nothing closes the surface where the box cuts it.
    opacity = np.pad(_step_opacity(scene, lattice), 1)
    opacity[ndimage.binary_fill_holes(opacity > 0.5) & (opacity <= 0.5)] = 1.0
    padded = lattice._replace(origin=lattice.origin - spacing_m)
    places, faces, *_ = marching_cubes(opacity, 0.5, gradient_direction="ascent")
    vertices = padded.at(_placed(scene, padded, places, opacity > 0.5))
    vertices, faces, floating = _large_parts(vertices, faces.astype(np.int32))
    return SurfaceMesh(vertices, faces, _colours(scene, vertices, faces), floating)


def _lattice(scene: CanonicalScene, spacing_m: float) -> _Lattice:
    lower, upper = scene.box
    shape = np.ceil((upper - lower) / spacing_m).astype(int) + 1
    count = float(np.prod(shape.astype(float)))
    if count > MOST_LATTICE_POINTS:
        least = spacing_m * (count / MOST_LATTICE_POINTS) ** (1 / 3)
        raise InputError(
            f"--spacing-m must ask for at most {MOST_LATTICE_POINTS / 1e6:.0f} million points",
            f"{spacing_m:g} m, which are {count / 1e6:.0f} million",
            f"Try {np.ceil(1000 * least) / 1000:g}.",
        )
    return _Lattice(lower, spacing_m, tuple(shape.tolist()))


def _step_opacity(scene: CanonicalScene, lattice: _Lattice) -> NDArray[np.float32]:
    """Opacity (X, Y, Z) of a typical step: one half on the surface, exact in its neighbourhood.

    A coarser lattice finds the surface; fine points are asked along it, wherever it leads.
    """
    opacity = _coarse_opacity(scene, lattice)
    known = np.zeros(lattice.shape, bool)
    while (wanted := _near_surface(opacity > 0.5) & ~known).any():
        found = _densities(scene, lattice.at(np.argwhere(wanted)))
        opacity[wanted] = _opacity(scene, found)
        known |= wanted
    return opacity


def _coarse_opacity(scene: CanonicalScene, lattice: _Lattice) -> NDArray[np.float32]:
    """The same, each point with the value of one that is next to it."""
    axes = [np.arange(0, count, _COARSE) for count in lattice.shape]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    density = _densities(scene, lattice.at(places.reshape(-1, 3)))
    if density.max() <= scene.surface_density:
        raise InputError(
            f"A surface must have a density of {scene.surface_density:.3g} /m",
            f"at most {density.max():.3g} /m",
            "Train the scene for longer.",
        )
    opacity = _opacity(scene, density).reshape(places.shape[:3])
    for axis, count in enumerate(lattice.shape):
        opacity = opacity.repeat(_COARSE, axis).take(range(count), axis)
    return opacity


def _opacity(scene: CanonicalScene, density: NDArray[np.float32]) -> NDArray[np.float32]:
    return 1.0 - np.exp2(-density / np.float32(scene.surface_density))


def _near_surface(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Points no farther from both sides than one coarse point from the next."""
    size = 2 * _COARSE + 1
    return ndimage.maximum_filter(inside, size) & ~ndimage.minimum_filter(inside, size)


def _placed(
    scene: CanonicalScene,
    lattice: _Lattice,
    places: NDArray[np.float32],
    inside: NDArray[np.bool_],
) -> Points:
    """Vertices in lattice coordinates (V, 3), moved along their lattice edges onto the surface.

    Marching cubes interpolates linearly, which density is not. The few vertices in the middle of a
    cell stay.
    """
    nodes = np.round(places).astype(int)
    off_node = np.abs(places - nodes) > 1e-3
    axis = off_node.argmax(1)
    rows = np.arange(len(places))
    first, second = nodes.copy(), nodes.copy()
    first[rows, axis] = np.floor(places[rows, axis])
    second[rows, axis] = first[rows, axis] + 1
    solid = inside[tuple(first.T)]
    crosses = (off_node.sum(1) == 1) & (solid != inside[tuple(second.T)])
    in_body = np.where(solid[:, None], first, second)[crosses].astype(float)
    in_air = np.where(solid[:, None], second, first)[crosses].astype(float)
    for _ in range(_HALVINGS):
        middle = 0.5 * (in_body + in_air)
        dense = _densities(scene, lattice.at(middle))[:, None] > scene.surface_density
        in_body, in_air = np.where(dense, middle, in_body), np.where(dense, in_air, middle)
    placed = places.astype(float)
    placed[crosses] = 0.5 * (in_body + in_air)
    return placed


def _densities(scene: CanonicalScene, points: Points) -> NDArray[np.float32]:
    chunks = torch.from_numpy(points.astype(np.float32)).split(_AT_ONCE)
    return torch.cat([scene.density(chunk) for chunk in chunks]).numpy()


def _large_parts(
    vertices: Points, faces: NDArray[np.int32]
) -> tuple[Points, NDArray[np.int32], int]:
    """The mesh without its small connected parts, and how many those were."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    size = (len(vertices), len(vertices))
    graph = sparse.csr_matrix((np.ones(len(edges), bool), tuple(edges.T)), shape=size)
    count, part = connected_components(graph, directed=False)
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    area_of_part = np.bincount(part[faces[:, 0]], area, minlength=count)
    large = area_of_part >= LEAST_AREA_SHARE * area.sum()
    kept = large[part]
    number = np.cumsum(kept, dtype=np.int32) - 1
    return vertices[kept], number[faces[kept[faces[:, 0]]]], int((~large).sum())


def _colours(
    scene: CanonicalScene, vertices: Points, faces: NDArray[np.int32]
) -> NDArray[np.float32]:
    """rgb (V, 3) of the surface, each point looked at from straight above."""
    normals = vertex_normals(vertices, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    points, looking = (torch.from_numpy(v.astype(np.float32)) for v in (vertices, -normals))
    seen = zip(points.split(_AT_ONCE), looking.split(_AT_ONCE), strict=True)
    return torch.cat([scene.colour(*chunk) for chunk in seen]).numpy()
