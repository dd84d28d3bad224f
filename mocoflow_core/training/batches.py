"""Training pixels: the frames on the device, and random rays where the person can be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.rays import Rays, pixel_rays
from mocoflow_core.rendering.posed_scene import PosedScene
from mocoflow_core.training.held_out import HeldOutPixels
from mocoflow_core.training.ranks import Ranks


@dataclass(frozen=True, eq=False)
class Batch:
    """R rays with what the camera saw along them: all of a step, or one rank's part."""

    rays: Rays
    rays_in_all: int  # of the step, on all ranks
    first_row: int  # training frame of the step's first ray
    row: Tensor  # (R,) training frame of each ray
    near: Tensor  # (R,) metres along the ray between which the person can be
    far: Tensor  # (R,)
    rgb: Tensor  # (R, 3) in [0, 1]
    mask: Tensor  # (R,) 1 on the person
    has_mask: Tensor  # (R,) 0 where the frame came without a mask
    background: Tensor  # (R, 3)
    jitter: Tensor  # (R, J) in [0, 1), as many as the scene's rays take

    def own_part(self, ranks: Ranks) -> Batch:
        """The rays that are this rank's, on its device: all ranks draw the same batch."""
        rows, device = ranks.part(len(self.rays)), ranks.device

        def these(values: Tensor) -> Tensor:
            return values[rows].to(device)

        return Batch(
            self.rays.select(rows).to(device),
            self.rays_in_all,
            self.first_row,
            these(self.row),
            these(self.near),
            these(self.far),
            these(self.rgb),
            these(self.mask),
            these(self.has_mask),
            these(self.background),
            these(self.jitter),
        )


class PixelSource(Protocol):
    """Where a step's rays come from."""

    def batch(self, rays: int, frames: int, generator: torch.Generator) -> Batch:
        """Random rays of a few frames."""

    def problem(self, batch: Batch) -> str | None:
        """What is wrong with a batch, in words; None if all is well."""


class TrainingPixels:
    """The training frames of a clip and, per frame, the pixels that the scene sends rays through.

    Of the fast representation those that can show the person, of the paper's networks all. Pixels
    that are held out to score the run are none of them. Raises InputError where the body is in
    sight of no frame.
    """

    def __init__(
        self,
        clip: Clip,
        scene: PosedScene,
        held_out: HeldOutPixels | None = None,
    ) -> None:
        """Args: scene with a row for each training frame."""
        rows = np.flatnonzero(~clip.held_out)
        self.jitters = scene.jitters
        self.camera = clip.camera
        pixels = clip.camera.width * clip.camera.height
        self.frames = torch.from_numpy(clip.frames[rows].reshape(len(rows), pixels, 3))
        self.masks = torch.from_numpy(clip.masks[rows].reshape(len(rows), pixels))
        self.has_mask = torch.from_numpy(clip.has_mask[rows])
        self.background = torch.from_numpy(clip.background.reshape(pixels, 3).copy())
        visible = [scene.pixels(clip.camera, row) for row in range(len(rows))]
        if held_out is not None:
            kept_out = torch.from_numpy(held_out.mask(clip)[rows])
            visible = [v.select(~kept_out[row][v.pixels]) for row, v in enumerate(visible)]
        self.candidates = torch.cat([v.pixels for v in visible])
        self.nearest = torch.cat([v.nearest for v in visible])
        self.farthest = torch.cat([v.farthest for v in visible])
        self.counts = torch.tensor([len(v.pixels) for v in visible])
        self.starts = torch.cumsum(self.counts, 0) - self.counts
        # A person who has left the picture leaves a frame without candidates.
        self.in_sight = self.counts.nonzero()[:, 0]
        self.numbers = clip.frame_indices[rows]
        if not (self.farthest > self.nearest).any():
            raise InputError(
                f"the body must be in sight of {clip.camera.name} in a training frame",
                f"one beside or behind the camera in all {len(rows)}",
                "Check the meshes' coordinates and the camera's R, t and K.",
            )

    def problem(self, batch: Batch) -> str | None:
        """Which frame brings colours or rays that are not finite; None if all is well."""
        numbers = (batch.rgb, batch.rays.origins, batch.rays.directions)
        stretch = torch.stack([batch.near, batch.far], -1)
        bad = ~torch.isfinite(torch.cat([*numbers, stretch], -1)).all(-1)
        if not bad.any():
            return None
        frame = self.numbers[int(batch.row[bad][0])]
        return f"frame {frame} has colours or rays that are not finite"

    def batch(self, rays: int, frames: int, generator: torch.Generator) -> Batch:
        """Rays of a few frames, uniform over frames and over each frame's candidate pixels."""
        draws = torch.randint(len(self.in_sight), (frames,), generator=generator)
        chosen = self.in_sight[draws]
        row = chosen.repeat_interleave(-(-rays // frames))[:rays]
        place = torch.rand(rays, generator=generator, dtype=torch.float64)
        found = self.starts[row] + (place * self.counts[row]).long()
        pixel = self.candidates[found]
        through, along = pixel_rays(self.camera, pixel)
        return Batch(
            through,
            rays,
            int(chosen[0]),
            row,
            self.nearest[found] * along,
            self.farthest[found] * along,
            self.frames[row, pixel].float() / 255.0,
            self.masks[row, pixel].float(),
            self.has_mask[row].float(),
            self.background[pixel].float() / 255.0,
            torch.rand(rays, self.jitters, generator=generator),
        )
