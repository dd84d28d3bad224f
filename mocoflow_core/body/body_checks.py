"""Findings about a body estimate that a user should see, each with its measured value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera

# dataset-formats: adults and tall children, standing at least once in the clip.
USUAL_HEIGHT_M = (1.2, 2.2)
USUAL_DISTANCE_M = (1.0, 15.0)
LEAST_OVERLAP = 0.6
# A sprinter's speed; an estimate that jumps to another person is faster.
FASTEST_M_S = 12.0
# A neighbouring frame that fits better by this much shows an estimate that is off by one.
SHIFT_GAIN = 0.02
SHIFTS = (-1, 0, 1)


def check_height(
    vertices: NDArray[np.floating], up: NDArray[np.float64]
) -> tuple[float, tuple[str, ...]]:
    """Extent along ``up`` in metres, the 90th percentile over frames (T, V, 3), and warnings."""
    height = float(np.percentile(np.ptp(vertices @ up, axis=1), 90))
    if USUAL_HEIGHT_M[0] <= height <= USUAL_HEIGHT_M[1]:
        return height, ()
    return height, (
        f"the body is {height:.2f} m tall "
        f"(usual: {USUAL_HEIGHT_M[0]} to {USUAL_HEIGHT_M[1]} m): wrong scale?",
    )


def check_distance(meshes_world: MeshSequence, camera: Camera) -> tuple[float, tuple[str, ...]]:
    """Median depth of the body in front of the camera, metres, and warnings."""
    depths = (meshes_world.vertices.mean(axis=1) @ camera.R.T + camera.t)[:, 2]
    distance = float(np.median(depths))
    if USUAL_DISTANCE_M[0] <= distance <= USUAL_DISTANCE_M[1]:
        return distance, ()
    return distance, (
        f"the body is {distance:.2f} m in front of {camera.name} "
        f"(usual: {USUAL_DISTANCE_M[0]:g} to {USUAL_DISTANCE_M[1]:g} m)",
    )


def check_path(meshes_world: MeshSequence, fps: float) -> tuple[float, tuple[str, ...]]:
    """Fastest motion of the body's centre between frames, metres per second, and warnings."""
    if len(meshes_world.vertices) < 2:
        return 0.0, ()
    steps = np.diff(np.median(meshes_world.vertices, axis=1), axis=0)
    speeds = np.linalg.norm(steps, axis=1) * fps / np.diff(meshes_world.frame_indices)
    row = int(speeds.argmax())
    if speeds[row] <= FASTEST_M_S:
        return float(speeds[row]), ()
    return float(speeds[row]), (
        f"the body moves at {speeds[row]:.1f} m/s at frame {meshes_world.frame_indices[row]} "
        f"(usual: below {FASTEST_M_S:g}): another person's mesh, or a jump of the estimate?",
    )


def check_overlap(
    clip: Clip, meshes_world: MeshSequence
) -> tuple[dict[int, float], tuple[str, ...]]:
    """Mean silhouette overlap with the masks, meshes moved by -1, 0, +1 source frames."""
    means = {shift: _overlap_shifted(clip, meshes_world, shift) for shift in SHIFTS}
    warnings = []
    if means[0] < LEAST_OVERLAP:
        warnings.append(
            f"the body's silhouettes overlap the masks by {means[0]:.2f} "
            f"(usual: above {LEAST_OVERLAP}): wrong axes, unit, person or frames?"
        )
    best = max(means, key=lambda shift: means[shift])
    if means[best] > means[0] + SHIFT_GAIN:
        warnings.append(
            f"silhouettes overlap better by {means[best] - means[0]:.3f} with the meshes moved "
            f"by {best:+d} frame: an estimate that starts at another frame?"
        )
    return means, tuple(warnings)


def _overlap_shifted(clip: Clip, meshes: MeshSequence, shift: int) -> float:
    moved = (clip.frame_indices + shift).clip(meshes.frame_indices[0], meshes.frame_indices[-1])
    bodies = silhouettes(meshes.at(moved).vertices, meshes.faces, clip.camera)
    return float(overlap(bodies, clip.masks).mean())
