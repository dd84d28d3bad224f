"""A trained scene, opened from its folder: any camera, any time, also between frames."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import load_file
from torch import Tensor

from mocoflow_core.body.rigid_controls import RigidControls
from mocoflow_core.fields.body_lattices import build_body_motion, canonical_nodes
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.motion_hybrid import Moments
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import pixel_rays
from mocoflow_core.rendering.pixels import ShellPixels, shell_pixels
from mocoflow_core.rendering.renderer import render_rays
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.threads import torch_threads

_RAYS_AT_ONCE = 16_384

Image = NDArray[np.float32]


class TrainedScene:
    """Renders deterministically: no jitter, no random state."""

    def __init__(
        self,
        field: SceneField,
        controls: RigidControls,
        shape: SceneShape,
        sampling: SamplingConfig,
        threads: int = 1,
    ) -> None:
        self.field = field.eval().requires_grad_(False)
        self.controls = controls
        self.shape = shape
        self.sampling = sampling
        self.threads = threads  # as many as the optimisation found worth it
        self._bodies: dict[float, BodyMotion] = {}
        self._canonical = canonical_nodes(controls, shape.shell_width_m, shape.motion.body)

    def share_bodies(self, other: TrainedScene) -> None:
        """Take over the moments that another state of the same scene has already prepared."""
        self._bodies = other._bodies

    def moments(self, time: float) -> Moments:
        """The motion at one moment, normalised time in [0, 1]."""
        if time not in self._bodies:
            self._bodies[time] = build_body_motion(
                self.controls.at_time(time),
                self.field.canonical.prior,
                self.shape.shell_width_m,
                self.shape.motion.body,
                self._canonical,
            )
        codes = self.field.motion.codes_at(torch.tensor([time]))
        return Moments(self._bodies[time], codes)

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
        time = float(np.clip(time, 0.0, 1.0))
        moments = self.moments(time)
        appearance = self.field.appearance_at(torch.tensor([time]))
        behind = np.ones((camera.height, camera.width, 3), np.float32)
        if background is not None:
            behind = background.astype(np.float32)
        rgb = torch.from_numpy(behind.reshape(-1, 3).copy())
        opacity = torch.zeros(len(rgb))
        shell = shell_pixels(camera, moments.body, 0, self.shape.shell_width_m)
        with torch_threads(self.threads):
            self._fill(rgb, opacity, camera, shell, moments, appearance)
        size = (camera.height, camera.width)
        return rgb.numpy().reshape(*size, 3), opacity.numpy().reshape(size)

    def _fill(
        self,
        rgb: Tensor,
        opacity: Tensor,
        camera: Camera,
        shell: ShellPixels,
        moments: Moments,
        appearance: Tensor,
    ) -> None:
        """Render the shell's pixels into ``rgb`` (H W, 3), which holds what is behind them."""
        for rows in torch.arange(len(shell.pixels)).split(_RAYS_AT_ONCE):
            chunk = shell.pixels[rows]
            rays, along = pixel_rays(camera, chunk)
            rendered = render_rays(
                self.field,
                moments,
                rays,
                torch.zeros(len(chunk), dtype=torch.int64),
                shell.nearest[rows] * along,
                shell.farthest[rows] * along,
                appearance,
                rgb[chunk],
                torch.full((len(chunk),), 0.5),
                self.shape.shell_width_m,
                self.sampling,
            )
            rgb[chunk] = rendered.rgb
            opacity[chunk] = rendered.opacity

    @classmethod
    def open(cls, folder: Path, weights: Path | None = None) -> TrainedScene:
        """Open a trained scene's folder, or one of its snapshots.

        Raises:
            FileNotFoundError: where a part of the scene is missing.
        """
        shape = SceneShape.model_validate_json((folder / "shape.json").read_text())
        density = CanonicalDensity.load(folder)
        field = shape.build(density.prior())
        field.load_state_dict(load_file(weights or folder / "model.safetensors"))
        sampling = SamplingConfig(step_m=shape.step_m, inner_depth_m=shape.inner_depth_m)
        result = folder / "result.json"
        threads = json.loads(result.read_text())["threads"] if result.is_file() else 1
        return cls(field, RigidControls.load(folder), shape, sampling, threads)
