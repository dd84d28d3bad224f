"""Where a body stands, precisely: its outline is laid onto the mask's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.agreement import signed_distance
from mocoflow_core.body.mask_crop import MaskCrop

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Points farther off than this many times the usual distance count less: limbs in another pose.
ROBUST_FACTOR = 2.0
# The gradient of a distance has length 1; much less shows a ridge between two outlines.
LEAST_GRADIENT = 0.7
# Masks are sharp to about half a pixel, so residuals below count fully.
LEAST_SCALE_PX = 0.5
# The outline is known to a fraction of a pixel; a smaller step changes nothing.
SMALL_STEP_PX = 0.02
SMALL_STEP_SHARE = 5e-4
# Distances are linear in the move only nearby; this also keeps the body before the camera.
LONGEST_STEP_SHARE = 0.2
# An outline has about so many parts that err on their own: limbs, and stretches of the trunk.
INDEPENDENT_PARTS = 30
# Too few points leave the four unknowns open.
LEAST_POINTS = 20


@dataclass(frozen=True, eq=False)
class _Shape:
    """A mask with its outline and its distances, in the pixels of a crop."""

    outline: NDArray[np.intp]  # (N, 2) row, column of the pixels inside, next to the edge
    distance: Array  # (S, S) signed, positive outside
    slope: Array  # (S, S, 2) its gradient in x and y

    @classmethod
    def of(cls, mask: Mask, crop: MaskCrop) -> Self:
        # Neither the crop's own border nor the image's is an outline.
        mask = crop.beyond(mask)
        inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)
        distance = signed_distance(mask).astype(np.float64)
        if mask.all() or not mask.any():
            return cls(np.empty((0, 2), np.intp), distance, np.zeros((*mask.shape, 2)))
        slope = np.stack([np.gradient(distance, axis=1), np.gradient(distance, axis=0)], axis=-1)
        return cls(np.argwhere(mask & (inner == 0) & crop.seen), distance, slope)


@dataclass(frozen=True, eq=False)
class _Offsets:
    """How far points of one outline lie outside the other shape, and which way is out."""

    pixels: Array  # (N, 2) x, y in the crop
    off: Array  # (N,) pixels
    normals: Array  # (N, 2) unit

    @classmethod
    def between(cls, points: NDArray[np.intp], shape: _Shape) -> Self:
        rows, columns = points.T
        off, slope = shape.distance[rows, columns], shape.slope[rows, columns]
        length = np.linalg.norm(slope, axis=-1)
        clear = np.isfinite(off) & (length > LEAST_GRADIENT)
        pixels = np.stack([columns, rows], axis=-1)[clear] + 0.5
        return cls(pixels, off[clear], slope[clear] / length[clear, None])


def fit_outline(
    points: Array,
    faces: NDArray[np.int32],
    crop: MaskCrop,
    start: Array,
    iterations: int,
    usual_offset_m: float,
) -> Array:
    """Translation (3,) that lays the outline of the body (V, 3) onto that of the crop's mask.

    Gauss-Newton on the distances between the two outlines, from each to the other, together with
    one offset that all of them share: clothes, and masks drawn wide or narrow, move the whole
    outline outward and say nothing of the distance. ``usual_offset_m`` is how large that offset
    usually is; limbs in another pose must not pass for it. Returns the best translation met,
    ``start`` among them.
    """
    target = _Shape.of(crop.coverage > 0.5, crop)
    best, least = start, np.inf
    translation = start
    for _ in range(iterations + 1):
        body = _Shape.of(crop.draw(points + translation, faces), crop)
        offsets = _both_ways(body, target)
        if len(offsets.off) < LEAST_POINTS:
            break
        unlike = float(np.mean(np.abs(offsets.off - np.median(offsets.off))))
        if unlike < least:
            best, least = translation, unlike
        depth = float((points.mean(axis=0) + translation)[2])
        step = _step(offsets, depth, crop.K, usual_offset_m * crop.focal_px / depth)
        step *= min(1.0, LONGEST_STEP_SHARE * depth / max(float(np.abs(step).max()), 1e-12))
        translation = translation + step
        step_px = np.abs(step[:2]).max() * crop.focal_px / depth
        if step_px < SMALL_STEP_PX and abs(step[2]) < SMALL_STEP_SHARE * depth:
            break
    return best


def _both_ways(body: _Shape, target: _Shape) -> _Offsets:
    """From the body's outline to the mask, and from the mask's to the body with its sign turned."""
    there = _Offsets.between(body.outline, target)
    back = _Offsets.between(target.outline, body)
    return _Offsets(
        np.concatenate([there.pixels, back.pixels]),
        # Both outlines consist of pixels half a pixel inside their edge.
        np.concatenate([there.off + 0.5, -(back.off + 0.5)]),
        np.concatenate([there.normals, back.normals]),
    )


def _step(offsets: _Offsets, depth: float, K: Array, usual_offset_px: float) -> Array:
    """The move (3,) in metres that best removes the distances, the shared offset apart."""
    off, normals = offsets.off, offsets.normals
    towards = (offsets.pixels - K[:2, 2]) / depth
    jacobian = np.stack(
        [
            normals[:, 0] * K[0, 0] / depth,
            normals[:, 1] * K[1, 1] / depth,
            -(normals * towards).sum(axis=1),
            -np.ones(len(off)),
        ],
        axis=-1,
    )
    usual = off - np.median(off)
    scale = max(ROBUST_FACTOR * float(np.median(np.abs(usual))), LEAST_SCALE_PX)
    weights = np.sqrt(1.0 / (1.0 + (usual / scale) ** 2))
    # Neighbouring points err alike, so all of them weigh no more than so many parts.
    prior = np.array([[0, 0, 0, scale / usual_offset_px * np.sqrt(len(off) / INDEPENDENT_PARTS)]])
    system = np.concatenate([jacobian * weights[:, None], prior])
    solution, *_ = np.linalg.lstsq(system, np.append(-off * weights, 0.0), rcond=None)
    return solution[:3]
