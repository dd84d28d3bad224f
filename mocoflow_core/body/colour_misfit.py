"""How much the colour of each point of a corrected body changes over the clip.

Outlines say nothing of the body's inside: of a twisted forearm, or of how deep a limb stands. A
point of the skin keeps its colour, though, up to the light that falls on it, and where the body
stands wrong it is seen on the wrong pixel in some frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from torch import Tensor

from mocoflow_core.body.joint_correction import JointCorrection, blend
from mocoflow_core.body.light import LightConfig, linear_light, measure_light
from mocoflow_core.body.mask_misfit import between, project
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import rasterise
from mocoflow_core.body.subdivide import Subdivision, subdivide
from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart

Array = NDArray[np.float64]


class ColourMisfitConfig(ConfigurationPart):
    """What is usual of colours, and which points are looked at."""

    points: int = Field(1500, ge=1, description="Points of the skin drawn for each step.")
    independent_points: int = Field(
        18, ge=0, description="Points of one frame whose colours err on their own; 0: no colours."
    )
    outlier: float = Field(0.5, gt=0, description="Change of log colour that counts little more.")
    darkest: float = Field(0.02, gt=0, description="Linear light that differences vanish below.")
    least_facing: float = Field(
        0.25, ge=0, lt=1, description="Cosine to the camera; points at flatter sights are left out."
    )
    behind_m: float = Field(0.03, gt=0, description="So far behind the first surface is seen yet.")
    edge_px: int = Field(1, ge=0, description="Pixels at the mask's edge that are not looked at.")
    blur_px: tuple[float, float] = Field(
        (1.2, 0.5), description="Blur of the pictures: in the first round, in the last."
    )
    light: LightConfig = LightConfig()


@dataclass(frozen=True, eq=False)
class _Sights:
    """The frames, and what of the skin they show as the body stands now."""

    pictures: Tensor  # (T, 3, H, W) linear light
    weights: Tensor  # (T, N) how well each point is seen, 0: not at all
    normals: Tensor  # (T, N, 3) unit, world
    shade: Tensor  # (T, N) brightness by the light's direction


class ColourMisfit:
    """Minus the logarithm of how likely the colours are, their noise unknown."""

    def __init__(
        self,
        clip: Clip,
        looked_at: NDArray[np.int64],
        rows: NDArray[np.int64],
        meshes: MeshSequence,
        part_weights: Array,
        configuration: ColourMisfitConfig,
    ) -> None:
        """Args: ``looked_at`` (T,) rows of the clip, ``rows`` (T,) the same frames' meshes.

        ``part_weights`` (V, P) are the skeleton's.
        """
        self._clip = clip
        self._looked_at = looked_at
        self._rows = rows
        self._meshes = meshes
        self._skin: Subdivision = subdivide(meshes.faces, meshes.vertices.shape[1], 1)
        places = np.stack([self._skin.refine(frame) for frame in meshes.vertices[rows]])
        self._places = torch.from_numpy(places).float()
        self._part_weights = torch.from_numpy(self._skin.refine(part_weights)).float()
        size = clip.frames.shape[2], clip.frames.shape[1]
        self._size = torch.tensor(size, dtype=torch.float32)
        self._configuration = configuration

    def look(self, correction: JointCorrection, share: float) -> _Sights:
        """What the frames show of the body as it stands now, after a share of the rounds."""
        blur_px = between(self._configuration.blur_px, share)
        with torch.no_grad():
            posed = correction.vertices(np.arange(len(self._meshes.vertices)))
        meshes = MeshSequence(self._meshes.frame_indices, posed, self._meshes.faces)
        light = measure_light(self._clip, meshes, self._configuration.light)
        seen, normals = zip(
            *(
                self._seen(position, posed[row])
                for position, row in zip(self._looked_at.tolist(), self._rows, strict=True)
            ),
            strict=True,
        )
        facing = np.stack(normals)
        return _Sights(
            torch.from_numpy(
                np.stack([self._picture(position, blur_px) for position in self._looked_at])
            ),
            torch.from_numpy(np.stack(seen)).float(),
            torch.from_numpy(facing).float(),
            # No light vector is longer than 0.9: this stays positive.
            torch.from_numpy(1.0 + facing @ light).float(),
        )

    def __call__(
        self, correction: JointCorrection, sights: _Sights, generator: torch.Generator
    ) -> Tensor:
        """Over a draw of points; zero where no point is seen.

        With noise of an unknown size, equal everywhere, the likelihood of the best size is a power
        of the mean square.
        """
        configuration = self._configuration
        chosen = torch.randperm(self._places.shape[1], generator=generator)
        chosen = chosen[: configuration.points]
        seen = sights.weights[:, chosen]
        if not bool((seen > 0).any()):
            return torch.zeros(())
        weights = self._part_weights[chosen].expand(len(self._rows), -1, -1)
        skin = blend(weights, correction.transforms(self._rows), self._places[:, chosen])
        # What is seen are the clothes, which stand off the mesh.
        skin = skin + sights.normals[:, chosen] * correction.stand_off(weights)[..., None]
        pixels, _ = project(self._clip.camera, skin)
        colour = _colours_at(sights.pictures, 2.0 * pixels / self._size - 1.0)
        logarithm = torch.log(colour / sights.shade[:, chosen, None] + configuration.darkest)
        usual = (seen[..., None] * logarithm).sum(0) / seen.sum(0)[:, None].clamp_min(1e-6)
        squared = ((logarithm - usual) ** 2).sum(-1)
        robust = squared / (1.0 + squared / configuration.outlier**2)
        mean = (seen * robust).sum() / seen.sum()
        frames = len(self._rows)
        return 0.5 * configuration.independent_points * frames * torch.log(mean + 1e-6)

    def _picture(self, position: int, blur_px: float) -> NDArray[np.float32]:
        """The person (3, H, W) in linear light, without what stands behind it."""
        light = linear_light(self._clip.frames[position])
        inside = self._clip.masks[position].astype(np.float64)
        blurred = _blur(light * inside[..., None], blur_px)
        share = _blur(inside, blur_px)[..., None]
        return (blurred / np.maximum(share, 1e-3)).transpose(2, 0, 1).astype(np.float32)

    def _seen(self, position: int, vertices: NDArray[np.float32]) -> tuple[Array, Array]:
        """How well each point of the skin is seen (N,), and its unit normal (N, 3)."""
        configuration, camera = self._configuration, self._clip.camera
        points = self._skin.refine(vertices)
        normals = self._skin.refine(vertex_normals(vertices, self._meshes.faces))
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
        sight = points - camera.centre_world
        sight /= np.maximum(np.linalg.norm(sight, axis=-1, keepdims=True), 1e-12)
        cosine = -(normals * sight).sum(-1)
        depth = camera.to_camera(points)[:, 2]
        x, y = camera.project(points).T
        inside = (x >= 0) & (y >= 0) & (x < camera.width) & (y < camera.height) & (depth > 0)
        candidates = np.flatnonzero(inside & (cosine > configuration.least_facing))
        row, column = y[candidates].astype(int), x[candidates].astype(int)
        first = rasterise(vertices, self._meshes.faces, camera).depth[row, column]
        kernel = np.ones((2 * configuration.edge_px + 1,) * 2, np.uint8)
        person = cv2.erode(self._clip.masks[position].astype(np.uint8), kernel)[row, column] > 0
        shown = candidates[person & (depth[candidates] < first + configuration.behind_m)]
        seen = np.zeros(len(points))
        seen[shown] = cosine[shown]
        return seen, normals


def _blur(image: Array, sigma_px: float) -> Array:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE))


def _colours_at(pictures: Tensor, places: Tensor) -> Tensor:
    """Bilinear colours (T, N, 3) at places (T, N, 2) in [-1, 1], corner origin."""
    found = torch.nn.functional.grid_sample(
        pictures, places[:, :, None], padding_mode="border", align_corners=False
    )
    return found[..., 0].transpose(1, 2)
