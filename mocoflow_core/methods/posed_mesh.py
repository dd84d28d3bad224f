"""The baseline: the given mesh, coloured from the train frames by projection, and rendered.

It is what a user has without any optimisation, made as good as this simple method gets:
colours as fine as the pixels, a median against outliers, and unseen parts filled in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy import ndimage, sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import rasterise
from mocoflow_core.body.subdivide import Subdivision, levels_for, subdivide, unique_edges
from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

WHITE = (1.0, 1.0, 1.0)
SUPERSAMPLING = 2  # rays along each side of a pixel
UNSEEN = 256  # sorts behind every byte


class PosedMeshConfig(ConfigurationPart):
    """How the given mesh is coloured."""

    max_spacing_m: float = Field(
        0.015, gt=0, description="Coloured vertices are at least this close."
    )
    max_spacing_px: float = Field(
        0.5, gt=0, description="Coloured vertices are at least this close in the train camera."
    )
    max_frames: int = Field(
        120, ge=1, description="Train frames looked at, evenly spread; bounds the memory."
    )
    max_vertices: int = Field(300_000, ge=1, description="No finer than this many vertices.")
    depth_tolerance_m: float = Field(
        0.02, gt=0, description="A vertex this far behind the first surface still counts as seen."
    )
    min_cosine: float = Field(
        0.4, ge=0, lt=1, description="Between normal and line of sight; flatter sights are skipped."
    )


@dataclass(frozen=True, eq=False)
class ColouredMesh:
    """A mesh with one colour per (fine) vertex, for any pose of the given coarse mesh."""

    faces: NDArray[np.int32]  # (F, 3) of the given mesh
    subdivision: Subdivision
    colours: NDArray[np.float32]  # (fine V, 3) sRGB-encoded in [0, 1]
    seen: NDArray[np.bool_]  # (fine V,) false where the colour is a neighbour's

    def render(
        self, camera: Camera, vertices_world: NDArray[np.floating], background: ArrayLike = WHITE
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The posed mesh over a background.

        Args:
            vertices_world: (V, 3) metres, of the given mesh in this frame.
            background: a colour (3,) or an image (H, W, 3) in [0, 1].

        Returns:
            Colour (H, W, 3) and opacity (H, W), means of 2 x 2 rays per pixel.
        """
        fine = camera.resized(SUPERSAMPLING * camera.width, SUPERSAMPLING * camera.height)
        raster = rasterise(vertices_world, self.faces, fine)
        covered = raster.covered
        face, weights = self.subdivision.locate(
            raster.face_index[covered], raster.barycentric[covered]
        )
        corners = self.colours[self.subdivision.faces[face]]
        image = np.zeros((fine.height, fine.width, 3), np.float32)
        image[covered] = np.einsum("nk,nkc->nc", weights, corners)
        opacity = _mean_of_blocks(covered[..., None].astype(np.float32))
        colour = _mean_of_blocks(image)
        behind = np.asarray(background, np.float32)
        return colour + (1.0 - opacity) * behind, opacity[..., 0]


def colour_mesh(
    clip: Clip, meshes: MeshSequence, configuration: PosedMeshConfig | None = None
) -> ColouredMesh:
    """Colour each vertex with its median over the train frames that see it.

    A frame sees a vertex that faces the camera, is not behind another surface, and falls inside
    the mask. Vertices that no frame sees take the colour of the nearest seen one along the
    surface. Held-out frames are not read.

    Raises:
        InputError: no train frame has a mask, or no vertex is seen inside any mask.
    """
    configuration = configuration or PosedMeshConfig()
    usable = np.flatnonzero(clip.has_mask & ~clip.held_out)
    rows = usable[:: -(-len(usable) // configuration.max_frames) or 1]
    if len(rows) == 0:
        raise InputError("a train frame with a mask", "none", "Give masks or a background.")
    posed = meshes.at(clip.frame_indices[rows])
    subdivision = _subdivision(posed, clip.camera, configuration)
    samples = np.full((len(rows), subdivision.weights.shape[0], 3), UNSEEN, np.int16)
    for sample, row, vertices in zip(samples, rows, posed.vertices, strict=True):
        points = subdivision.refine(vertices.astype(np.float64))
        normals = subdivision.refine(vertex_normals(vertices, posed.faces))
        sample[:] = _sample(clip, int(row), points, normals, vertices, posed.faces, configuration)
    colours, seen = _median(samples)
    if not seen.any():
        raise InputError(
            "a mesh that overlaps the masks in some frame",
            "no vertex inside a mask",
            "Check the cameras, the mesh's coordinates and its location.",
        )
    rest = subdivision.refine(posed.vertices[0].astype(np.float64))
    return ColouredMesh(
        posed.faces, subdivision, _fill(colours, seen, rest, subdivision.faces), seen
    )


def _subdivision(
    posed: MeshSequence, camera: Camera, configuration: PosedMeshConfig
) -> Subdivision:
    """The given triangles split until neighbours are about a pixel apart."""
    depth = float(np.median(camera.to_camera(posed.vertices.astype(np.float64))[..., 2]))
    pixel_m = abs(depth) / float(camera.K[0, 0])
    spacing = min(configuration.max_spacing_px * pixel_m, configuration.max_spacing_m)
    levels = levels_for(posed.vertices[0], posed.faces, spacing, configuration.max_vertices)
    return subdivide(posed.faces, posed.vertices.shape[1], levels)


def _sample(
    clip: Clip,
    row: int,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    vertices: NDArray[np.floating],
    faces: NDArray[np.int32],
    configuration: PosedMeshConfig,
) -> NDArray[np.int16]:
    """Bilinear colours (fine V, 3) in one frame, ``UNSEEN`` where it does not show the vertex."""
    camera = clip.camera
    depth = camera.to_camera(points)[:, 2]
    sights = points - camera.centre_world
    cosine = -np.einsum("nk,nk->n", sights, normals) / np.maximum(
        np.linalg.norm(sights, axis=1) * np.linalg.norm(normals, axis=1), 1e-12
    )
    x, y = camera.project(points).T
    inside = (x >= 0) & (y >= 0) & (x < camera.width) & (y < camera.height)
    candidates = np.flatnonzero(inside & (depth > 0) & (cosine > configuration.min_cosine))
    x, y = x[candidates], y[candidates]
    fine = camera.resized(SUPERSAMPLING * camera.width, SUPERSAMPLING * camera.height)
    first = rasterise(vertices, faces, fine).depth[
        (SUPERSAMPLING * y).astype(int), (SUPERSAMPLING * x).astype(int)
    ]
    shown = depth[candidates] < first + configuration.depth_tolerance_m
    shown &= clip.masks[row][y.astype(int), x.astype(int)]
    seen = candidates[shown]
    colours = np.full((len(points), 3), UNSEEN, np.int16)
    # Pixel centres are at +0.5 here and at integers in scipy.
    where = np.stack([y[shown] - 0.5, x[shown] - 0.5])
    for channel in range(3):
        image = np.asarray(clip.frames[row, ..., channel], np.float32)
        sampled = ndimage.map_coordinates(image, where, order=1, mode="nearest")
        colours[seen, channel] = sampled.round().astype(np.int16)
    return colours


def _median(samples: NDArray[np.int16]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Median colour (V, 3) over the frames (T, V, 3) that show a vertex, and whether any does.

    The samples are sorted in place; ``UNSEEN`` ends up behind the others.
    """
    counts = np.count_nonzero(samples[..., 0] != UNSEEN, axis=0)
    samples.sort(axis=0)
    vertices = np.arange(samples.shape[1])
    low = samples[np.maximum(counts - 1, 0) // 2, vertices]
    high = samples[np.minimum(counts // 2, len(samples) - 1), vertices]
    return (low.astype(np.float32) + high) / 510.0, counts > 0


def _fill(
    colours: NDArray[np.float32],
    seen: NDArray[np.bool_],
    points: NDArray[np.float64],
    faces: NDArray[np.int32],
) -> NDArray[np.float32]:
    """Give unseen vertices the colour of the nearest seen one along the surface.

    Parts of the mesh without a seen vertex take the nearest one through space.
    """
    edges, _ = unique_edges(faces)
    # An edge of length zero would be no edge to the graph library.
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) + 1e-9
    size = (len(points), len(points))
    graph = sparse.csr_matrix((lengths, (edges[:, 0], edges[:, 1])), shape=size)
    _, _, source = dijkstra(
        graph,
        directed=False,
        indices=np.flatnonzero(seen),
        min_only=True,
        return_predecessors=True,
    )
    apart = source < 0
    if apart.any():
        _, nearest = cKDTree(points[seen]).query(points[apart])
        source[apart] = np.flatnonzero(seen)[nearest]
    return colours[source]


def _mean_of_blocks(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean (H, W, C) over the supersampled pixels of an image (2 H, 2 W, C)."""
    height, width, channels = image.shape
    blocks = (height // SUPERSAMPLING, SUPERSAMPLING, width // SUPERSAMPLING, SUPERSAMPLING)
    return image.reshape(*blocks, channels).mean(axis=(1, 3))
