"""Frames and masks of a textured surface in the room, by ray casting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.synthetic.background import Background, shadow_pixels
from mocoflow_core.synthetic.light import ambient, lamp, lamp_visibility
from mocoflow_core.synthetic.pixel_rays import PixelBox
from mocoflow_core.synthetic.ray_caster import Hits, RayCaster
from mocoflow_core.synthetic.surface import Surface
from mocoflow_core.synthetic.texture import Array, encode_srgb

Shadows = Literal["none", "cast"]

_SHADOW_REACH = 3.0  # Farther from the ring's axis the person's shadow does not fall, metres.


@dataclass(frozen=True, eq=False)
class Picture:
    """One frame of one camera."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB-encoded
    mask: NDArray[np.bool_]  # (H, W) the person covers at least half of the pixel


class FrameRenderer:
    """The person at one moment, ready for every camera: one embree scene, one set of normals."""

    def __init__(self, surface: Surface, vertices: NDArray[np.float64], shadows: Shadows) -> None:
        self._surface = surface
        self._vertices = vertices.astype(np.float32)
        self._normals = surface.normals(vertices).astype(np.float32)
        self._caster = RayCaster(self._vertices, surface.faces)
        self._shadows = shadows

    def render(self, camera: Camera, background: Background, supersampling: int) -> Picture:
        """Linear light averaged over each pixel's samples, then sRGB-encoded."""
        box = PixelBox.around(self._vertices, camera)
        directions = box.rays(camera, supersampling)
        origins = np.broadcast_to(camera.centre_world.astype(np.float32), directions.shape)
        hits = self._caster.hit(origins, directions)
        samples = supersampling**2
        pixels = hits.rays // samples
        count = box.shape[0] * box.shape[1]
        coverage = (np.bincount(pixels, minlength=count) / samples).reshape(*box.shape, 1)
        shaded = self._shade(hits)
        light = np.stack(
            [np.bincount(pixels, shaded[:, k], minlength=count) for k in range(3)], axis=-1
        ).reshape(*box.shape, 3)
        inside = (slice(box.top, box.bottom), slice(box.left, box.right))
        image = self._shadowed(background)
        image[inside] = light / samples + (1 - coverage) * image[inside]
        mask = np.zeros(image.shape[:2], bool)
        mask[inside] = coverage[..., 0] >= 0.5
        return Picture(encode_srgb(image), mask)

    def _shade(self, hits: Hits) -> Array:
        """Linear light (N, 3) that leaves the surface at the hits."""
        faces = self._surface.faces
        normals = hits.interpolate(self._normals, faces)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        irradiance = ambient(normals)
        lamplight = lamp(normals)
        if self._shadows == "cast":
            points = hits.interpolate(self._vertices, faces) + 0.01 * normals
            lamplight = lamplight * lamp_visibility(points, self._caster)
        rest = hits.interpolate(self._surface.rest_vertices, faces)
        albedo = self._surface.albedo(rest, self._surface.face_parts[hits.faces])
        return albedo * (irradiance + lamplight)[:, None]

    def _shadowed(self, background: Background) -> Array:
        """A copy of the room's light (H, W, 3), with the person's shadow where it is cast."""
        if self._shadows == "none":
            return background.light.copy()
        near = shadow_pixels(background, _SHADOW_REACH)
        visible = np.ones((*near.shape, 1), np.float32)
        visible[near, 0] = lamp_visibility(background.points[near], self._caster)
        return np.asarray(background.ambient + visible * background.lamp, np.float32)
