"""Where the body stands and where it faces, before anything is fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from mocoflow_core.body.fit.fittable_body import LANDMARKS, FittableBody
from mocoflow_core.body.fit.freedom import FREEDOM
from mocoflow_core.body.fit.posed_body import BodyPose, Mixtures, PosedBody
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.geometry.nearest_rotation import rotation_by_svd

Array = NDArray[np.float64]

# Head, shoulders and hips move with the body; limbs do as they like.
_TRUNK = np.array(
    [
        1.0 if name.split("_")[-1] in ("nose", "eye", "ear", "shoulder", "hip") else 0.05
        for name in LANDMARKS
    ]
)
_HEADINGS = 36
# Turning from frame to frame that is worth one usual error of the landmarks.
_TURN = np.radians(30.0)
_USUAL_ERROR_M = 0.05


def first_guess(
    body: FittableBody, sightings: Sightings, K: Array, up: Array, shape: Array
) -> BodyPose:
    """The usual pose, turned and placed as the landmarks say; frames without any lie between.

    With landmarks in space the rotation is Kabsch's; without, the person stands along ``up``
    and the headings of all frames are chosen together.
    """
    frames = len(sightings.places)
    standing = _standing(body, sightings.points(body), shape)
    if sightings.world is not None:
        rotations = _turned_in_space(standing, sightings)
    else:
        rotations = _headings(standing, sightings, K, up)
    rotations = _between_seen(rotations, sightings.seen)
    places = np.stack(
        [
            _place(standing @ r.T, s, c, K)
            for r, s, c in zip(rotations, sightings.places, sightings.confidence, strict=True)
        ]
    )
    return BodyPose(
        _places_between(places, sightings.seen),
        rotations,
        np.tile(FREEDOM.usual, (frames, 1)),
        shape,
        np.zeros(len(body.parents)),
    )


def _standing(body: FittableBody, points: Mixtures, shape: Array) -> Array:
    """Landmarks (21, 3) in the usual pose at the origin."""
    pose = BodyPose(
        np.zeros((1, 3)), np.eye(3)[None], FREEDOM.usual[None], shape, np.zeros(len(body.parents))
    )
    return PosedBody.of(body, pose).points(points.shaped(shape))[0]


def _turned_in_space(standing: Array, sightings: Sightings) -> Array:
    """Rotations (T, 3, 3) from the rest pose's axes to the camera's (Kabsch)."""
    assert sightings.world is not None
    weights = _TRUNK * sightings.confidence
    share = (weights / np.maximum(weights.sum(1, keepdims=True), 1e-9))[..., None]
    seen = sightings.world - (share * sightings.world).sum(1, keepdims=True)
    covariance = np.swapaxes(share * seen, 1, 2) @ standing
    return rotation_by_svd(covariance)


def _headings(standing: Array, sightings: Sightings, K: Array, up: Array) -> Array:
    """Rotations (T, 3, 3) of the standing body: the likeliest path of headings."""
    angles = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    upright = _upright(up)
    turns = upright @ Rotation.from_rotvec(angles[:, None] * [0, 0, 1]).as_matrix()
    cost = np.stack(
        [
            [_unlike(standing @ turn.T, s, c, K) for turn in turns]
            for s, c in zip(sightings.places, sightings.confidence, strict=True)
        ]
    )
    apart = (angles[:, None] - angles + np.pi) % (2 * np.pi) - np.pi
    turning = 0.5 * (apart / _TURN) ** 2
    return turns[_cheapest_path(cost, turning)]


def _upright(up: Array) -> Array:
    """A rotation that takes the rest pose's +z to ``up``."""
    back = np.array([0.0, 0.0, 1.0]) - up[2] * up
    back = back / np.linalg.norm(back) if np.linalg.norm(back) > 1e-3 else np.array([1.0, 0, 0])
    return np.stack([np.cross(back, up), back, up], axis=1)


def _cheapest_path(cost: Array, change: Array) -> NDArray[np.int64]:
    """Viterbi: one column for each row of ``cost`` (T, N), changes priced by ``change`` (N, N)."""
    total, origins = cost[0], []
    for row in cost[1:]:
        ways = total[:, None] + change
        origins.append(ways.argmin(0))
        total = ways.min(0) + row
    path = [int(total.argmin())]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return np.array(path[::-1])


def _weak(turned: Array, seen: Array, trust: Array) -> tuple[float, Array, Array, Array]:
    """Pixels for each metre, middles in the picture and in space, and shares, by least squares."""
    weights = _TRUNK * trust
    share = (weights / max(weights.sum(), 1e-9))[:, None]
    middle, origin = (share * seen).sum(0), (share * turned).sum(0)
    ours, theirs = (turned - origin)[:, :2], seen - middle
    # Turning spreads the body's breadth, not its height: the size is that of all, whatever fits.
    size = np.sqrt((share * theirs**2).sum() / max((share * ours**2).sum(), 1e-9))
    return float(max(size, 1e-6)), middle, origin, share


def _unlike(turned: Array, seen: Array, trust: Array, K: Array) -> float:
    """How badly a turned body fits, in usual errors squared."""
    size, middle, origin, share = _weak(turned, seen, trust)
    off = (turned - origin)[:, :2] - (seen - middle) / size
    squared = (off**2).sum(1) / _USUAL_ERROR_M**2
    return 0.5 * float((share[:, 0] * np.log1p(squared)).sum()) * min(float(trust.sum()), 17.0)


def _place(turned: Array, seen: Array, trust: Array, K: Array) -> Array:
    """The root (3,) that shows the turned body as large and where it was seen."""
    size, middle, origin, _ = _weak(turned, seen, trust)
    depth = np.sqrt(K[0, 0] * K[1, 1]) / size
    ray = np.linalg.solve(K, np.append(middle, 1.0))
    return depth * ray - origin


def _between_seen(rotations: Array, seen: NDArray[np.bool_]) -> Array:
    known = np.flatnonzero(seen)
    if len(known) == 1:
        return np.broadcast_to(rotations[known[0]], rotations.shape)
    times = np.arange(len(seen)).clip(known[0], known[-1])
    return Slerp(known, Rotation.from_matrix(rotations[known]))(times).as_matrix()


def _places_between(places: Array, seen: NDArray[np.bool_]) -> Array:
    known, times = np.flatnonzero(seen), np.arange(len(seen))
    return np.stack([np.interp(times, known, column[known]) for column in places.T], -1)
