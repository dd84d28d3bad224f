"""Outlines of masks and of posed bodies, and which points of the two belong together."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree
from skimage.measure import find_contours

from mocoflow_core.body.silhouette import NEAR_M, silhouette
from mocoflow_core.geometry.camera import Camera

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Blurs, in pixels, that make a mask's edge and its direction known between pixels.
_EDGE_BLUR_PX = 0.7
_DIRECTION_BLUR_PX = 1.2
# Where the body's own blurred silhouette covers more, an edge is not outline but lies before it:
# the outline itself is covered by half, a point one pixel inside by 0.92.
_RIM_COVERAGE = 0.7


@dataclass(frozen=True, eq=False)
class MaskOutline:
    """Points on the edge of a mask; the picture's own border is no edge."""

    pixels: Array  # (N, 2) x, y, corner origin
    normals: Array  # (N, 2) unit, outward

    @classmethod
    def of(cls, mask: Mask, most: int) -> MaskOutline:
        """At most about ``most`` points, evenly along the edge."""
        smooth = _blurred(mask, _DIRECTION_BLUR_PX)
        contours = find_contours(_blurred(mask, _EDGE_BLUR_PX), 0.5)
        if not contours:
            return cls(np.zeros((0, 2)), np.zeros((0, 2)))
        points = np.concatenate(contours)[:, ::-1]
        points = points[:: max(1, len(points) // most)]
        slope = np.stack(
            [cv2.Scharr(smooth, cv2.CV_32F, 1, 0), cv2.Scharr(smooth, cv2.CV_32F, 0, 1)], -1
        )
        column, row = np.round(points).astype(np.int64).T
        outward = -slope[row, column].astype(np.float64)
        length = np.linalg.norm(outward, axis=1)
        known = length > 1e-6
        return cls(points[known] + 0.5, outward[known] / length[known, None])


@dataclass(frozen=True, eq=False)
class BodyOutline:
    """Edges of a mesh on the outline of its projection: where the surface turns out of sight."""

    edges: NDArray[np.int64]  # (N, 2) vertices
    pixels: Array  # (N, 2) of the middles
    normals: Array  # (N, 2) unit, outward
    depth: Array  # (N,) metres before the camera


@dataclass(frozen=True, eq=False)
class EdgeTopology:
    """Inner edges of a mesh with the two faces at each."""

    faces: NDArray[np.int64]  # (F, 3)
    edges: NDArray[np.int64]  # (E, 2)
    beside: NDArray[np.int64]  # (E, 2)

    @classmethod
    def of(cls, faces: NDArray[np.int32]) -> EdgeTopology:
        corners = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        corners = np.sort(corners.astype(np.int64), axis=1)
        face = np.tile(np.arange(len(faces)), 3)
        order = np.lexsort((face, corners[:, 1], corners[:, 0]))
        corners, face = corners[order], face[order]
        same = np.flatnonzero((corners[1:] == corners[:-1]).all(axis=1))
        return cls(
            faces.astype(np.int64), corners[same], np.stack([face[same], face[same + 1]], -1)
        )

    def outline(self, vertices: Array, camera: Camera) -> BodyOutline:
        """The outline of the body (V, 3) as the camera sees it."""
        points = camera.to_camera(np.asarray(vertices, np.float64))
        corners = points[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        seen = (normals * corners[:, 0]).sum(-1) < 0
        turning = seen[self.beside[:, 0]] != seen[self.beside[:, 1]]
        edges, beside = self.edges[turning], self.beside[turning]
        middles = points[edges].mean(axis=1)
        projected = middles @ camera.K.T
        pixels = projected[:, :2] / np.maximum(projected[:, 2:], NEAR_M)
        outward = (_unit(normals[beside[:, 0]]) + _unit(normals[beside[:, 1]]))[:, :2]
        drawn = silhouette(vertices, self.faces.astype(np.int32), camera)
        inside = (pixels > 1).all(axis=1) & (pixels < [camera.width - 1, camera.height - 1]).all(1)
        keep = inside & (middles[:, 2] > NEAR_M) & (_coverage(drawn, pixels) < _RIM_COVERAGE)
        return BodyOutline(edges[keep], pixels[keep], _unit(outward[keep]), middles[keep, 2])


def _blurred(mask: Mask, sigma_px: float) -> NDArray[np.float32]:
    solid = mask.astype(np.float32)
    blurred = cv2.GaussianBlur(solid, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, np.float32)


def _coverage(mask: Mask, pixels: Array) -> Array:
    """How much (N,) of a blurred mask covers points (N, 2) between pixel centres."""
    rows_columns = (pixels[:, ::-1] - 0.5).T
    return map_coordinates(_blurred(mask, _EDGE_BLUR_PX), rows_columns, order=1, mode="nearest")


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


@dataclass(frozen=True, eq=False)
class Matches:
    """Pairs of points on a body's outline and on a mask's."""

    body: NDArray[np.int64]  # (M,) rows of the body's outline
    mask: NDArray[np.int64]  # (M,) rows of the mask's outline


def match_outlines(
    body: BodyOutline, mask: MaskOutline, turn_px: float, least_agreement: float
) -> Matches:
    """The partner of every point of either outline: near it, and facing the same way.

    Args:
        turn_px: pixels that a difference of one between the unit normals is worth.
        least_agreement: cosine between normals below which a pair is dropped.
    """
    if not len(body.pixels) or not len(mask.pixels):
        none = np.zeros(0, np.int64)
        return Matches(none, none)
    ours = np.concatenate([body.pixels, turn_px * body.normals], axis=1)
    theirs = np.concatenate([mask.pixels, turn_px * mask.normals], axis=1)
    _, nearest_body = cKDTree(ours).query(theirs)
    _, nearest_mask = cKDTree(theirs).query(ours)
    pairs = Matches(
        np.concatenate([nearest_body, np.arange(len(ours))]),
        np.concatenate([np.arange(len(theirs)), nearest_mask]),
    )
    agree = (body.normals[pairs.body] * mask.normals[pairs.mask]).sum(1) > least_agreement
    return Matches(pairs.body[agree], pairs.mask[agree])
