"""Findings about the motion of a body estimate: a tracker that froze, lost a frame, or flipped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rigid_controls import best_rotation
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.strange_frames import listed

Mask = NDArray[np.bool_]

# No living body holds still to this from frame to frame; an estimator that repeats itself does.
FROZEN_M = 1e-5
SHORTEST_FREEZE = 3  # frames
# Between frames that are so far apart, the way from one to the other is a guess.
LARGEST_TURN_DEG = 90.0
# A frame whose silhouette fits so much worse than the clip's usual one has another frame's mask.
LARGEST_DROP = 0.3
SAMPLED_VERTICES = 512


def check_frozen(meshes: MeshSequence) -> tuple[str, ...]:
    """Frames in which a mesh that moves elsewhere repeats itself."""
    steps = np.abs(np.diff(meshes.vertices, axis=0)).max(axis=(1, 2), initial=0.0)
    still = steps < FROZEN_M
    if still.all():
        return ()
    frozen = np.zeros(len(meshes.vertices), bool)
    for start, end in _runs(still):
        if end - start + 1 >= SHORTEST_FREEZE:
            frozen[start : end + 1] = True
    if not frozen.any():
        return ()
    frames = listed(meshes.frame_indices[frozen].tolist())
    return (f"the mesh does not move in {frames}: a tracker that lost the person?",)


def check_turns(meshes: MeshSequence) -> tuple[str, ...]:
    """Turns of the whole body between frames that are too far to be followed."""
    angles = turns_deg(meshes)
    far = angles > LARGEST_TURN_DEG
    if not far.any():
        return ()
    row = int(angles.argmax())
    return (
        f"the body turns by up to {angles[row]:.0f} degrees between frames (at frame "
        f"{meshes.frame_indices[row]}; {far.sum()} above {LARGEST_TURN_DEG:g}): moments between "
        "them are a guess; an estimate that flips, or a rate that is too low?",
    )


def turns_deg(meshes: MeshSequence) -> NDArray[np.float64]:
    """Rotation (T - 1,) of the body as a whole between neighbouring meshes, degrees."""
    stride = max(meshes.vertices.shape[1] // SAMPLED_VERTICES, 1)
    bodies = meshes.vertices[:, ::stride].astype(np.float64)
    centred = (bodies - bodies.mean(axis=1, keepdims=True)).astype(np.float32)
    turns = best_rotation(centred[:-1], centred[1:]).astype(np.float64)
    cosine = 0.5 * (np.trace(turns, axis1=-2, axis2=-1) - 1.0)
    return np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))


def check_agreement(clip: Clip, meshes_world: MeshSequence) -> tuple[str, ...]:
    """Single frames whose mask fits the body far worse than the others' do."""
    used = np.flatnonzero(~clip.held_out & clip.has_mask & clip.masks.any(axis=(1, 2)))
    if not len(used):
        return ()
    posed = meshes_world.at(clip.frame_indices[used])
    agreement = overlap(silhouettes(posed.vertices, posed.faces, clip.camera), clip.masks[used])
    usual = float(np.median(agreement))
    poor = agreement < usual - LARGEST_DROP
    if not poor.any():
        return ()
    frames = listed(clip.frame_indices[used][poor].tolist())
    return (
        f"the body overlaps the mask by {agreement[poor].min():.2f} at worst in {frames}, usually "
        f"by {usual:.2f}: frames in a wrong order, or an estimate that lost the person there?",
    )


def _runs(flags: Mask) -> list[tuple[int, int]]:
    """First and one-past-last index of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
