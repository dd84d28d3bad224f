"""How much of the body the train camera never sees: nothing is known of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import rasterise
from mocoflow_core.capture.clip import Clip
from mocoflow_core.metrics.views import spread_frames

# So many frames show what all of them do: a turn past them is 8 degrees from one to the next.
FRAMES = 48
# A vertex behind the surface of its pixel by no more than this lies on it: meshes have facets.
ON_SURFACE_M = 0.02
# Less than this is never seen of anybody: soles, armpits.
USUAL_SHARE = 0.1


def unseen_share(clip: Clip, meshes: MeshSequence) -> float:
    """Share of the body's surface that no training frame shows. ``meshes`` at the clip's frames."""
    trained = clip.frame_indices[~clip.held_out]
    posed = meshes.at(np.array(spread_frames(trained, FRAMES), np.int32))
    seen = np.zeros(posed.vertices.shape[1], bool)
    for vertices in posed.vertices.astype(np.float64):
        seen |= _seen(vertices, posed.faces, clip)
    areas = _vertex_areas(posed.vertices[0].astype(np.float64), posed.faces)
    return float(areas[~seen].sum() / areas.sum())


def visibility_warnings(share: float, camera: str) -> tuple[str, ...]:
    """What is invented where nothing is seen, said with its share."""
    if share <= USUAL_SHARE:
        return ()
    return (
        f"{camera} never sees {100 * share:.0f} % of the body's surface: "
        "views of these parts are filled in from what surrounds them",
    )


def _seen(vertices: NDArray[np.float64], faces: NDArray[np.int32], clip: Clip) -> NDArray[np.bool_]:
    """Which vertices (V,) lie on the first surface behind the pixel that they project to."""
    depth = clip.camera.to_camera(vertices)[:, 2]
    pixels = np.floor(clip.camera.project(vertices)).astype(int)
    limits = (clip.camera.width, clip.camera.height)
    inside = ((pixels >= 0) & (pixels < limits)).all(axis=1) & (depth > 0)
    columns, rows = pixels.clip(0, np.subtract(limits, 1)).T
    surface = rasterise(vertices, faces, clip.camera).depth[rows, columns]
    # A vertex on the outline may fall into a pixel whose centre misses the body: nothing is nearer.
    return inside & (depth <= surface + ON_SURFACE_M)


def _vertex_areas(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=-1)
    at_corners = np.repeat(areas / 3.0, 3)
    return np.bincount(faces.ravel(), at_corners, len(vertices)).astype(np.float64)
