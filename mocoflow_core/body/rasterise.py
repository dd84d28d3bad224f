"""Which triangle of a mesh each pixel sees, by casting one ray through its centre."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.ray.ray_pyembree import RayMeshIntersector

from mocoflow_core.geometry.camera import Camera

Floats = NDArray[np.float64]


class Raster(NamedTuple):
    """A mesh as one camera sees it. Pixels that miss it: face -1, weights 0, depth infinite."""

    face_index: NDArray[np.int32]  # (H, W)
    barycentric: NDArray[np.float32]  # (H, W, 3) weights of the face's corners, sum 1
    depth: NDArray[np.float32]  # (H, W) metres along the camera's z axis

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Pixels (H, W) whose centre sees the mesh."""
        return self.face_index >= 0


def rasterise(
    vertices_world: NDArray[np.floating], faces: NDArray[np.int32], camera: Camera
) -> Raster:
    """The first surface behind the centre of each pixel of an undistorted camera.

    Args:
        vertices_world: (V, 3) metres.
        faces: (F, 3), both sides are seen.

    Returns:
        Face, barycentric weights and depth of each pixel; weights are exact to rounding in
        float64, whatever the precision of the ray caster's own distances.
    """
    vertices = camera.to_camera(np.asarray(vertices_world, np.float64))
    rays = pixel_rays(camera).reshape(-1, 3)
    looked_at = _rays_near(vertices, camera)
    hit_faces = np.full(len(rays), -1, np.int32)
    hit_faces[looked_at] = _first_hits(vertices, faces, rays[looked_at])
    weights = np.zeros((len(rays), 3), np.float32)
    depth = np.full(len(rays), np.inf, np.float32)
    seen = np.flatnonzero(hit_faces >= 0)
    weights[seen], depth[seen] = _intersect(vertices[faces[hit_faces[seen]]], rays[seen])
    size = (camera.height, camera.width)
    return Raster(hit_faces.reshape(size), weights.reshape(*size, 3), depth.reshape(size))


def interpolate(raster: Raster, faces: NDArray[np.int32], values: NDArray) -> NDArray:
    """Vertex values (V, C) at each pixel (H, W, C); zero where no face is seen."""
    image = np.zeros((*raster.face_index.shape, values.shape[1]), values.dtype)
    corners = values[faces[raster.face_index[raster.covered]]]
    image[raster.covered] = np.einsum("nk,nkc->nc", raster.barycentric[raster.covered], corners)
    return image


def surface_points(raster: Raster, camera: Camera) -> Floats:
    """World points (N, 3) that the covered pixels see, in row order."""
    rays = pixel_rays(camera)[raster.covered]
    return camera.to_world(rays * raster.depth[raster.covered, None])


def pixel_rays(camera: Camera) -> Floats:
    """Directions (H, W, 3) through the pixel centres in the camera's axes, with z = 1."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([columns, rows, np.ones_like(columns)], axis=-1)
    return pixels @ np.linalg.inv(camera.K).T


def _rays_near(vertices_camera: Floats, camera: Camera) -> NDArray[np.bool_]:
    """Pixels (H * W,) inside the projected vertices' box; all of them if some lie behind."""
    near = np.ones((camera.height, camera.width), bool)
    if vertices_camera[:, 2].min() > 0:
        projected = vertices_camera @ camera.K.T
        pixels = projected[:, :2] / projected[:, 2:]
        left, top = np.floor(pixels.min(axis=0))
        right, bottom = np.ceil(pixels.max(axis=0))
        columns, rows = np.arange(camera.width), np.arange(camera.height)
        near &= ((columns >= left) & (columns <= right))[None, :]
        near &= ((rows >= top) & (rows <= bottom))[:, None]
    return near.ravel()


def _first_hits(vertices: Floats, faces: NDArray[np.int32], rays: Floats) -> NDArray[np.int32]:
    """Index of the first face that each ray from the origin meets, -1 where there is none."""
    if len(rays) == 0 or len(faces) == 0:
        return np.full(len(rays), -1, np.int32)
    mesh = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    hits = RayMeshIntersector(mesh).intersects_first(np.zeros_like(rays), rays)
    return hits.astype(np.int32)


def _intersect(corners: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Barycentric weights (N, 3) and z (N,) where rays from the origin meet their triangles.

    Cramer's rule for ``ray * z = w0 a + w1 b + w2 c`` (Moeller and Trumbore 1997), with the
    weights clipped to the triangle, because a ray caster in single precision may report a
    triangle whose edge the exact ray just misses.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volumes = np.stack(
        [_volume(rays, b, c), _volume(rays, c, a), _volume(rays, a, b)],
        axis=1,
    )
    total = volumes.sum(axis=1, keepdims=True)
    flat = np.abs(total) < np.finfo(np.float64).tiny
    weights = np.where(flat, 1.0 / 3.0, volumes / np.where(flat, 1.0, total)).clip(0.0, None)
    weights /= weights.sum(axis=1, keepdims=True)
    return weights, np.einsum("nk,nk->n", weights, corners[..., 2])


def _volume(u: Floats, v: Floats, w: Floats) -> Floats:
    """Signed volume (N,) of the parallelepiped over three vectors."""
    return np.einsum("nk,nk->n", u, np.cross(v, w))
