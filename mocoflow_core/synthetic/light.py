"""The light of the room: a hemisphere and one soft lamp, fixed in the world."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.synthetic.ray_caster import RayCaster

Array = NDArray[np.float32]

_AMBIENT, _LAMP = 0.62, 0.42  # Linear irradiance from the hemisphere and from the lamp.
_SKY_SHARE = 0.22  # How much brighter a surface that looks up is than one that looks sideways.
_WRAP = 0.35  # The lamp is broad: its light reaches a little round the terminator.
_TO_LAMP = np.array([-0.45, -0.55, 0.7035624], np.float32)  # A unit vector.
_LAMP_RADIUS = 0.16  # Of the lamp's disc as seen from one metre, for soft shadows.
_SHADOW_RAYS = 8
_SHADOW_START = 0.01  # Metres off the surface, lest it shadows itself.


def ambient(normals: Array) -> Array:
    """Irradiance (N,) of the hemisphere on surfaces with these unit normals (N, 3)."""
    return np.float32(_AMBIENT) * (1 + np.float32(_SKY_SHARE) * normals[:, 2])


def lamp(normals: Array) -> Array:
    """Irradiance (N,) of the unshadowed lamp."""
    facing = (normals @ _TO_LAMP + np.float32(_WRAP)) / np.float32(1 + _WRAP)
    return np.float32(_LAMP) * facing.clip(0)


def lamp_visibility(points: Array, caster: RayCaster) -> Array:
    """Share (N,) of the lamp's disc that the body does not hide from each point (N, 3)."""
    visible = np.zeros(len(points), np.float32)
    for direction in _lamp_directions():
        starts = points + _SHADOW_START * direction
        visible += ~caster.occluded(starts, np.broadcast_to(direction, points.shape))
    return visible / np.float32(_SHADOW_RAYS)


def _lamp_directions() -> Array:
    """Directions over the lamp's disc, a sunflower pattern."""
    side = np.cross(_TO_LAMP, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, _TO_LAMP)
    index = np.arange(_SHADOW_RAYS) + 0.5
    radius = _LAMP_RADIUS * np.sqrt(index / _SHADOW_RAYS)
    angle = index * np.pi * (3 - np.sqrt(5))
    offsets = (radius * np.cos(angle))[:, None] * side + (radius * np.sin(angle))[:, None] * up
    return (_TO_LAMP + offsets).astype(np.float32)
