"""Images of the canonical mesh from all sides: what the density is pretrained on."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from torch import Tensor

from mocoflow_core.body.rasterise import interpolate, rasterise
from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import pixel_rays
from mocoflow_core.rendering.box_scene import BoxScene
from mocoflow_core.training.batches import Batch


class MeshViewsConfig(ConfigurationPart):
    """Views of the canonical mesh."""

    views: int = Field(100, ge=1, description="evenly spread over the sphere")
    side_px: int = Field(200, ge=8, description="square images")
    on_body: float = Field(
        0.5, ge=0, le=1, description="share of rays through the body: nothing but background kills"
    )
    distance: float = Field(3.0, gt=1, description="in radii of the mesh from its middle")


class MeshViews:
    """Random rays of one view each step. Colours are the directions that the surface faces."""

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.int32],
        scene: BoxScene,
        configuration: MeshViewsConfig,
    ) -> None:
        """Args: vertices (V, 3) of the canonical mesh; scene at the canonical moment alone."""
        self.scene = scene
        self.on_body = configuration.on_body
        self.cameras = cameras_around(vertices, configuration)
        normals = vertex_normals(vertices, faces)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        colours = 0.5 + 0.5 * normals / np.maximum(length, np.finfo(np.float64).tiny)
        self.rgb, self.masks = [], []
        for camera in self.cameras:
            raster = rasterise(vertices, faces, camera)
            rgb = np.where(raster.covered[..., None], interpolate(raster, faces, colours), 1.0)
            self.rgb.append(torch.from_numpy(rgb.reshape(-1, 3)).float())
            self.masks.append(torch.from_numpy(raster.covered.reshape(-1)).float())

    def batch(self, rays: int, frames: int, generator: torch.Generator) -> Batch:
        """Rays of one view, uniform over its pixels, on white; ``frames`` is always one."""
        view = int(torch.randint(len(self.cameras), (1,), generator=generator))
        camera = self.cameras[view]
        pixel = self._pixels(view, rays, generator)
        through, _ = pixel_rays(camera, pixel)
        row = torch.zeros(rays, dtype=torch.int64)
        near, far = self.scene.boxes.intersect(through, row)
        hit = far > near
        return Batch(
            through,
            rays,
            0,
            row,
            torch.where(hit, near, 0.0),
            torch.where(hit, far, 0.0),
            self.rgb[view][pixel],
            self.masks[view][pixel],
            torch.ones(rays),
            torch.ones(rays, 3),
            torch.rand(rays, self.scene.jitters, generator=generator),
        )

    def _pixels(self, view: int, rays: int, generator: torch.Generator) -> Tensor:
        """Flat indices (R,): a share on the body, the rest anywhere.

        Where nearly every ray sees background, a ReLU of density ends below zero everywhere, and
        has no gradient to come back.
        """
        anywhere = torch.randint(len(self.masks[view]), (rays,), generator=generator)
        body = self.masks[view].nonzero()[:, 0]
        if not len(body):
            return anywhere
        chosen = body[torch.randint(len(body), (rays,), generator=generator)]
        to_body = torch.rand(rays, generator=generator) < self.on_body
        return torch.where(to_body, chosen, anywhere)

    def problem(self, batch: Batch) -> str | None:
        """Rasterised views are finite."""
        return None


def cameras_around(vertices: NDArray[np.float32], configuration: MeshViewsConfig) -> list[Camera]:
    """Cameras on a sphere around a mesh (V, 3), all of it in sight of each.

    The places are a Fibonacci lattice: equal areas, no poles.
    """
    lower, upper = vertices.min(0).astype(np.float64), vertices.max(0).astype(np.float64)
    middle, radius = 0.5 * (lower + upper), 0.5 * float(np.linalg.norm(upper - lower))
    number = np.arange(configuration.views) + 0.5
    height = 1.0 - 2.0 * number / configuration.views
    around = np.pi * (1.0 + np.sqrt(5.0)) * number
    flat = np.sqrt(1.0 - height**2)
    places = np.stack([flat * np.cos(around), flat * np.sin(around), height], 1)
    return [_camera(-place, middle, radius, configuration, n) for n, place in enumerate(places)]


def _camera(
    forward: NDArray[np.float64],
    middle: NDArray[np.float64],
    radius: float,
    configuration: MeshViewsConfig,
    number: int,
) -> Camera:
    aside = np.eye(3)[np.abs(forward).argmin()]
    right = np.cross(forward, aside)
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    centre = middle - configuration.distance * radius * forward
    side = configuration.side_px
    focal = 0.5 * side * np.sqrt(configuration.distance**2 - 1.0)  # the sphere fills the image
    K = np.array([[focal, 0.0, 0.5 * side], [0.0, focal, 0.5 * side], [0.0, 0.0, 1.0]])
    return Camera(f"view{number:03d}", side, side, K, R, -R @ centre)
