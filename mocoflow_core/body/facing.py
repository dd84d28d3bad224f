"""Which frames show the side of the body that the first one shows: the back, for any topology."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.capture.scene import Scene
from mocoflow_core.geometry.camera import Camera

Indices = NDArray[np.int32]


def shown_share(body: IngestedMeshes, camera: Camera) -> NDArray[np.float64]:
    """How much of the surface that faces the camera in the first frame does so in each, (T,).

    1 in the first frame, about a half from the side, near 0 from behind. No mesh says where its
    front is; what the first frame shows takes its place. Surface hidden by other parts counts as
    facing: this measures the body's direction, which is known without its location.

    Args:
        body: of constant topology; root-centred bodies are seen along the camera's axis.
        camera: the train camera.
    """
    facing = np.stack([_facing(v, body, camera) for v in body.meshes.vertices])
    first = body.meshes.vertices[0].astype(np.float64)
    areas = np.linalg.norm(vertex_normals(first, body.meshes.faces), axis=-1)
    shown = areas * facing[0]
    return facing @ shown / max(shown.sum(), np.finfo(float).tiny)


def frames_that_show(ingested: Path, scene: Scene, least: float) -> Indices:
    """Source numbers of the frames that show at least this share of the first frame's side.

    ``ingested``: folder with a saved ``IngestedMeshes``.
    """
    body = IngestedMeshes.load(ingested)
    shares = shown_share(body, scene.cameras[scene.train_camera])
    return body.meshes.frame_indices[shares >= least]


def turned_away_warning(kept: int, frames: int, least: float) -> tuple[str, ...]:
    """How many of the clip's frames were not looked at, said where any was not."""
    if kept == frames:
        return ()
    return (
        f"{frames - kept} of {frames} frames are not looked at: they show less than "
        f"{100 * least:.0f} % of the side that the first frame shows",
    )


def _facing(
    vertices: NDArray[np.float32], body: IngestedMeshes, camera: Camera
) -> NDArray[np.bool_]:
    """Which vertices (V,) are turned to the camera."""
    points = vertices.astype(np.float64)
    rays = np.array([0.0, 0.0, 1.0])
    if body.coordinates == "world":
        points = camera.to_camera(points)
        rays = points if body.located else rays
    return (vertex_normals(points, body.meshes.faces) * rays).sum(axis=-1) < 0
