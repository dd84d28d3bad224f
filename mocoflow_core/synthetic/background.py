"""The room behind the person: a plank floor with a rug, four papered walls, a ceiling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.synthetic.light import ambient, lamp
from mocoflow_core.synthetic.pixel_rays import PixelBox
from mocoflow_core.synthetic.texture import Array, Noise, checker, linear, stripes, within

_LOW = np.array([-4.2, -4.2, 0.0], np.float32)
_HIGH = np.array([4.2, 4.2, 3.0], np.float32)
_PLANK, _RUG_RADIUS, _SKIRTING = 0.16, 1.15, 0.12  # Metres.
_PAPER = ("#b9c7ae", "#c9b79c", "#a9bccb", "#cbb3b3")  # -x, +x, -y, +y.


@dataclass(frozen=True, eq=False)
class Background:
    """The empty room as one camera sees it, linear light, so that a shadow can dim the lamp."""

    ambient: Array  # (H, W, 3)
    lamp: Array  # (H, W, 3)
    points: Array  # (H, W, 3) world metres at the pixels' centres

    @property
    def light(self) -> Array:
        return self.ambient + self.lamp


def render_background(camera: Camera, supersampling: int, seed: int) -> Background:
    """The empty room, averaged over the samples of each pixel."""
    whole = PixelBox.whole(camera)
    points, normals = _hit_room(camera, whole.rays(camera, supersampling))
    colours = _albedo(points, normals, Noise(seed + 1))
    shape = (camera.height, camera.width, supersampling**2, 3)
    centres, _ = _hit_room(camera, whole.rays(camera, 1))
    return Background(
        (colours * ambient(normals)[:, None]).reshape(shape).mean(axis=2),
        (colours * lamp(normals)[:, None]).reshape(shape).mean(axis=2),
        centres.reshape(camera.height, camera.width, 3),
    )


def _hit_room(camera: Camera, directions: Array) -> tuple[Array, Array]:
    """Points and inward normals where rays from inside the box leave it."""
    centre = camera.centre_world.astype(np.float32)
    safe = np.where(np.abs(directions) < 1e-9, np.float32(1e-9), directions)
    distances = np.where(safe > 0, (_HIGH - centre) / safe, (_LOW - centre) / safe)
    axis = distances.argmin(axis=1)
    points = centre + distances.min(axis=1)[:, None] * directions
    normals = np.zeros_like(points)
    rows = np.arange(len(points))
    normals[rows, axis] = -np.sign(directions[rows, axis])
    return points, normals


def _albedo(points: Array, normals: Array, noise: Noise) -> Array:
    colours = np.empty_like(points)
    floor, ceiling = normals[:, 2] > 0.5, normals[:, 2] < -0.5
    colours[floor] = _floor(points[floor], noise)
    colours[ceiling] = linear("#d9d4c8")
    for wall, paper in enumerate(_PAPER):
        axis, sign = divmod(wall, 2)
        chosen = normals[:, axis] * (1 - 2 * sign) > 0.5
        along = points[chosen][:, 1 - axis]
        colours[chosen] = _wall(along + 3.1 * wall, points[chosen], paper, noise)
    grain = 0.10 * noise(points, 0.04) + 0.10 * noise(points, 0.35)
    return colours * (1 + grain)[:, None]


def _floor(points: Array, noise: Noise) -> Array:
    x, y = points[:, 0], points[:, 1]
    plank = np.floor(x / _PLANK)
    shade = 0.78 + 0.22 * np.sin(12.9898 * plank + 4.1 * np.floor(y / 1.3 + 0.37 * plank))
    grain = 1 + 0.25 * noise(points, (0.02, 0.4, 1.0))
    colours = linear("#9a6b42") * (shade * grain)[:, None]
    colours[within(x / _PLANK - plank, 0, 0.07)] = linear("#4a2f1b")
    radius = np.hypot(x, y)
    rug = radius < _RUG_RADIUS
    colours[rug] = linear("#6b6a86")
    colours[rug & stripes(radius, 0.3)] = linear("#8a86a0")
    colours[within(radius, _RUG_RADIUS - 0.06, _RUG_RADIUS)] = linear("#d8cfae")
    return colours


def _wall(along: Array, points: Array, paper: str, noise: Noise) -> Array:
    z = points[:, 2]
    colours = np.repeat(linear(paper)[None], len(z), axis=0)
    colours[stripes(along, 0.36)] *= 0.82
    dado = z < 0.95
    colours[dado] = linear("#8b7a66")
    colours[dado & within(along % 0.6, 0.0, 0.05)] = linear("#5e5143")
    colours[within(z, 0.95, 1.02)] = linear("#e2dac8")
    u, v = along % 1.9 - 0.95, z - 1.65
    colours[(np.abs(u) < 0.42) & (np.abs(v) < 0.36)] = linear("#33291f")
    picture = (np.abs(u) < 0.37) & (np.abs(v) < 0.31)
    hue = noise(np.stack([u, v, np.floor(along / 1.9)], axis=-1), (0.2, 0.2, 0.73))[:, None]
    painted = linear("#c7683c") * (0.5 + 0.5 * hue) + linear("#2f6a8f") * (0.5 - 0.5 * hue)
    colours[picture] = painted[picture]
    colours[picture & checker(u, v, 0.09)] *= 0.7
    colours[z < _SKIRTING] = linear("#e8e2d4")
    return colours


def shadow_pixels(background: Background, reach: float) -> NDArray[np.bool_]:
    """(H, W) pixels whose point of the room lies within ``reach`` metres of the ring's axis."""
    return np.hypot(background.points[..., 0], background.points[..., 1]) < reach
