"""A trained scene, opened from its folder: any camera, any time, also between frames."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import load_file
from torch import Tensor

from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays, pixel_rays
from mocoflow_core.rendering.box_space import BoxSpace
from mocoflow_core.rendering.pixels import VisiblePixels
from mocoflow_core.rendering.posed_scene import PosedScene, RenderedRays, Space
from mocoflow_core.rendering.shell_space import ShellSpace
from mocoflow_core.threads import torch_threads

Image = NDArray[np.float32]

SPACES: dict[str, type[ShellSpace] | type[BoxSpace]] = {"hybrid": ShellSpace, "networks": BoxSpace}


class TrainedScene:
    """Renders deterministically: no jitter, no random state."""

    def __init__(self, space: Space, field: SceneField, threads: int = 1) -> None:
        self.space = space
        self.field = field.eval().requires_grad_(False)
        self.threads = threads  # as many as the optimisation found worth it

    @classmethod
    def open(
        cls, folder: Path, weights: Path | None = None, space: Space | None = None
    ) -> TrainedScene:
        """Open a trained scene's folder, or one of its snapshots.

        Args:
            space: of another state of the same scene, with the moments that it has prepared.

        Raises:
            FileNotFoundError: where a part of the scene is missing.
        """
        space = space or open_space(folder)
        field = space.build()
        field.load_state_dict(load_file(weights or folder / "model.safetensors"))
        result = folder / "result.json"
        threads = json.loads(result.read_text())["threads"] if result.is_file() else 1
        return cls(space, field, threads)

    def at(self, time: float) -> PosedScene:
        """The scene at a normalised time; outside [0, 1] it is clamped to the clip."""
        moment = torch.tensor([np.clip(time, 0.0, 1.0)], dtype=torch.float64)
        return self.space.at(self.field, moment)

    @torch.no_grad()
    def render(
        self, camera: Camera, time: float, background: Image | None = None
    ) -> tuple[Image, Image]:
        """What a camera sees at a moment.

        Args:
            camera: a pinhole in world space.
            time: normalised; outside [0, 1] it is clamped to the clip.
            background: (H, W, 3) in [0, 1]; white where None.

        Returns:
            rgb (H, W, 3) in [0, 1] and opacity (H, W).
        """
        behind = np.ones((camera.height, camera.width, 3), np.float32)
        if background is not None:
            behind = background.astype(np.float32)
        rgb = torch.from_numpy(behind.reshape(-1, 3).copy())
        opacity = torch.zeros(len(rgb))
        posed = self.at(time)
        visible = posed.pixels(camera, 0)
        with torch_threads(self.threads):
            for chunk in torch.arange(len(visible.pixels)).split(posed.rays_at_once):
                pixels = visible.pixels[chunk]
                _, rendered = render_pixels(posed, camera, visible.select(chunk), rgb[pixels])
                rgb[pixels] = rendered.rgb
                opacity[pixels] = rendered.opacity
        size = (camera.height, camera.width)
        return rgb.numpy().reshape(*size, 3), opacity.numpy().reshape(size)


def render_pixels(
    posed: PosedScene, camera: Camera, visible: VisiblePixels, background: Tensor
) -> tuple[Rays, RenderedRays]:
    """Pixels (N,) of a camera at a scene's only moment, over background (N, 3); no jitter."""
    count = len(visible.pixels)
    rays, along = pixel_rays(camera, visible.pixels)
    rendered = posed.render(
        rays,
        torch.zeros(count, dtype=torch.int64),
        visible.nearest * along,
        visible.farthest * along,
        background,
        torch.full((count, posed.jitters), 0.5),
    )
    return rays, rendered


def open_space(folder: Path) -> Space:
    """What a trained scene's folder holds besides the weights."""
    shape = json.loads((folder / "shape.json").read_text())
    return SPACES[shape["representation"]].load(folder)
