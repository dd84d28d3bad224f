"""Whether the light on the person changes over the clip."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera

# The surface must face the camera by this cosine: grazing views change colour with every pixel.
LEAST_FACING = 0.5
# Texture is blurred over so many pixels, so that a misplaced mesh still reads the same colour.
BLUR_PX = 5
# A vertex tells something of the light when seen in at least this share of the frames.
LEAST_SEEN = 0.2


def brightness_shifts(clip: Clip, meshes: MeshSequence) -> NDArray[np.float64]:
    """How much brighter the person is in each frame than usual, (T,), 0 to 1; nan if unseen.

    Each vertex is compared with its own median over the frames that see it, so that a turning
    person whose back is darker than the front does not count. ``meshes`` at the clip's frames.
    """
    seen = np.stack(
        [
            _luminance(frame, mask, vertices, meshes.faces, clip.camera)
            for frame, mask, vertices in zip(clip.frames, clip.masks, meshes.vertices, strict=True)
        ]
    )
    known = np.isfinite(seen)
    seen = seen[:, known.mean(axis=0) >= LEAST_SEEN]
    if not seen.size:
        return np.full(len(clip.frames), np.nan)
    shifts = seen - np.nanmedian(seen, axis=0)
    visible = np.isfinite(shifts).any(axis=1)
    result = np.full(len(shifts), np.nan)
    result[visible] = np.nanmedian(shifts[visible], axis=1)
    return result


def _luminance(
    frame: NDArray[np.uint8],
    mask: NDArray[np.bool_],
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    camera: Camera,
) -> NDArray[np.float64]:
    """Brightness at each vertex (V,) that faces the camera inside the mask; nan elsewhere."""
    grey = cv2.blur(cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY), (BLUR_PX, BLUR_PX))
    points = camera.to_camera(vertices.astype(np.float64))
    pixels = np.floor(camera.project(vertices.astype(np.float64))).astype(int)
    normals = vertex_normals(points, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    facing = -(normals * points).sum(-1) / np.linalg.norm(points, axis=-1)
    inside = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)
    columns, rows = pixels.clip(0, (camera.width - 1, camera.height - 1)).T
    visible = inside & (points[:, 2] > 0) & (facing > LEAST_FACING) & mask[rows, columns]
    return np.where(visible, grey[rows, columns] / 255.0, np.nan)
