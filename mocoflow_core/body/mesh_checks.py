"""What a mesh estimate must satisfy before anything is built on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

# A person measures between these in metres, child or adult, crouched or stretched; a file in
# another unit is off by ten or more and falls outside.
PLAUSIBLE_SIZE_M = (0.3, 8.0)
UNIT_SIZES_M = {
    "millimetres": 0.001,
    "centimetres": 0.01,
    "inches": 0.0254,
    "decimetres": 0.1,
    "decametres": 10.0,
    "hectometres": 100.0,
    "kilometres": 1000.0,
}
TYPICAL_SIZE_M = 1.7
# Nobody is filmed from nearer or farther; ten times that is a matter of units.
PLAUSIBLE_DISTANCE_M = (0.1, 150.0)
# float32 tells a millimetre apart up to here; coordinates of a map are farther off.
FARTHEST_M = 1e4
# Longer gaps are not bridged: a limb can turn round in the meantime.
LONGEST_GAP_S = 0.25


def require_shapes(meshes: MeshSequence) -> None:
    """Raise InputError unless the arrays belong together and the faces name existing vertices."""
    vertices, faces = meshes.vertices, meshes.faces
    if vertices.ndim != 3 or vertices.shape[2] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError(
            "meshes must have vertices (T, V, 3) and faces (F, 3)",
            f"{vertices.shape} and {faces.shape}",
            "Write the mesh file again.",
        )
    if len(vertices) != len(meshes.frame_indices):
        raise InputError(
            "meshes must have one frame index for each mesh",
            f"{len(meshes.frame_indices)} indices for {len(vertices)} meshes",
            "Write frame_indices again.",
        )
    if not len(faces) or faces.min() < 0 or faces.max() >= vertices.shape[1]:
        found = f"{faces.min()} to {faces.max()}" if len(faces) else "no face"
        raise InputError(
            f"faces must name vertices 0 to {vertices.shape[1] - 1}", found, "Correct the faces."
        )
    regressor = meshes.keypoint_regressor
    if regressor is not None and regressor.shape != (17, vertices.shape[1]):
        raise InputError(
            f"keypoint_regressor must be (17, {vertices.shape[1]})",
            f"{regressor.shape}",
            "Correct it or leave it out.",
        )


def require_finite(meshes: MeshSequence) -> None:
    """Raise InputError at the first NaN or infinite vertex."""
    broken = np.argwhere(~np.isfinite(meshes.vertices).all(axis=2))
    if len(broken):
        row, vertex = broken[0]
        raise InputError(
            "mesh vertices must be finite",
            f"{len(broken)} that are not, the first at frame {meshes.frame_indices[row]}, "
            f"vertex {vertex}",
            "Repair the estimate, or cut the clip to the frames it covers.",
        )


def require_metres(meshes: MeshSequence) -> None:
    """Raise InputError when the body's size is off by ten or more; names the likely unit."""
    size = body_size(meshes.vertices)
    if PLAUSIBLE_SIZE_M[0] <= size <= PLAUSIBLE_SIZE_M[1]:
        return
    ratio = TYPICAL_SIZE_M / max(size, 1e-12)
    unit = min(UNIT_SIZES_M, key=lambda name: abs(np.log(UNIT_SIZES_M[name] / ratio)))
    raise InputError(
        f"mesh vertices must be in metres, a body of {PLAUSIBLE_SIZE_M[0]} to "
        f"{PLAUSIBLE_SIZE_M[1]:g} m",
        f"one of {size:.4g}",
        f"Likely {unit}: multiply the vertices by {UNIT_SIZES_M[unit]:g}.",
    )


def require_frames(meshes: MeshSequence, expected: NDArray[np.int32], fps: float) -> None:
    """Raise InputError unless the meshes belong to the video's frames, small gaps apart."""
    given = meshes.frame_indices
    counts = f"{len(given)} meshes for {len(expected)} frames"
    action = (
        "Fit the body to this very video, cut either to the same frames, or say with "
        "--set meshes.first_frame=N where the estimate begins."
    )
    if len(np.unique(given)) != len(given):
        raise InputError("each frame must have one mesh", "frames that come twice", action)
    foreign = np.setdiff1d(given, expected)
    if len(foreign):
        found = f"{counts}, with frame {foreign[0]} that the video does not have"
        raise InputError("meshes must belong to the train camera's frames", found, action)
    missing = np.setdiff1d(expected, given)
    gap_s = (np.diff(given).max() / fps) if len(given) > 1 else np.inf
    uncovered = given[0] != expected[0] or given[-1] != expected[-1]
    if len(missing) and (uncovered or gap_s > LONGEST_GAP_S):
        raise InputError(
            "meshes must cover the train camera's frames, "
            f"gaps up to {LONGEST_GAP_S} s inside apart",
            f"{counts}, none for frame {missing[0]}",
            action,
        )


def require_near_origin(meshes: MeshSequence) -> None:
    """Raise InputError where coordinates are too large for float32 to hold a body's shape."""
    farthest = float(np.abs(meshes.vertices).max())
    if farthest > FARTHEST_M:
        raise InputError(
            f"coordinates must lie within {FARTHEST_M / 1000:g} km of the origin",
            f"one of {farthest:.4g} m",
            "Subtract one offset from the meshes and from all camera positions (t + R offset).",
        )


def require_in_front(meshes_world: MeshSequence, camera: Camera) -> None:
    """Raise InputError when the body is behind the camera or absurdly far from it."""
    depths = (meshes_world.vertices.mean(axis=1) @ camera.R.T + camera.t)[:, 2]
    depth = float(np.median(depths))
    low, high = PLAUSIBLE_DISTANCE_M
    if low <= depth <= high:
        return
    if depth < low:
        action = (
            "Camera axes are OpenCV's: x right, y down, z forward; R and t take world to camera."
        )
    else:
        action = f"Check the unit of t of {camera.name} and of the meshes: both are metres."
    raise InputError(
        f"the body must be {low} to {high:g} m in front of {camera.name}",
        f"a depth of {depth:.4g} m",
        action,
    )


def body_size(vertices: NDArray[np.floating]) -> float:
    """The longest side of a body's box, in file units; the median over the frames."""
    return float(np.median(np.ptp(vertices, axis=1).max(axis=1)))
