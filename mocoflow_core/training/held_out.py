"""Pixels of the train camera that are never trained on: they score the run while it goes on."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.geometry.rays import Rays, pixel_rays
from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.metrics.views import spread_frames
from mocoflow_core.rendering.posed_scene import PosedScene, Space

# Scored pixels are those of the person and of a rim around it, a share of the longer side wide:
# density that stands off the person must cost something.
_RIM = 1.0 / 64.0
_FRAMES = 8  # that the scored pixels come from; each needs a look-up table of its own
# Where no frame is held out, blocks of pixels are: single ones would be told by their neighbours.
_BLOCK_PX = 4
_LARGEST_SHARE = 0.05  # of these frames' pixels, kept out of training in blocks
_SEED = 0  # the same pixels in every run, so that runs can be compared


@dataclass(frozen=True, eq=False)
class HeldOutPixels:
    """P pixels with what the train camera saw there. No other camera is asked."""

    rows: NDArray[np.int64]  # (P,) of the clip
    pixels: NDArray[np.int64]  # (P,) flat indices
    description: str  # what they are, for people

    def mask(self, clip: Clip) -> NDArray[np.bool_]:
        """The pixels as pictures (T, H W): true where nothing may be learned from."""
        marked = np.zeros((len(clip.frames), clip.frames[0].size // 3), bool)
        marked[self.rows, self.pixels] = True
        return marked


def draw_held_out(clip: Clip, count: int) -> HeldOutPixels | None:
    """A fixed draw of at most ``count`` pixels on and around the person, for ``train_psnr``.

    From held-out frames, or else in blocks from training frames. None where no mask shows the
    person.
    """
    generator = np.random.default_rng(_SEED)
    shown = clip.has_mask & clip.masks.any(axis=(1, 2))
    held_out = np.flatnonzero(shown & clip.held_out)
    if len(held_out):
        rows = np.array(spread_frames(held_out, _FRAMES))
        row, pixel = np.nonzero(np.stack([_rim(clip.masks[r]).ravel() for r in rows]))
        drawn = np.sort(generator.permutation(len(row))[:count])
        text = f"{len(drawn)} pixels of {len(rows)} held-out frames of {clip.camera.name}"
        return HeldOutPixels(rows[row[drawn]], pixel[drawn], text)
    rows = np.array(spread_frames(np.flatnonzero(shown & ~clip.held_out), _FRAMES))
    return _draw_blocks(clip, rows, count, generator) if len(rows) else None


def _draw_blocks(
    clip: Clip, rows: NDArray[np.int64], count: int, generator: np.random.Generator
) -> HeldOutPixels:
    rims = np.stack([_rim(clip.masks[row]) for row in rows])
    height, width = rims.shape[1:]
    middles = rims[:, _BLOCK_PX // 2 :: _BLOCK_PX, _BLOCK_PX // 2 :: _BLOCK_PX]
    row, down, right = np.nonzero(middles)
    wanted = min(count, _LARGEST_SHARE * int(rims.sum())) / _BLOCK_PX**2
    # One block at least, so that even the smallest scene has a score.
    drawn = np.sort(generator.permutation(len(row))[: max(round(wanted), 1)])
    block = np.arange(_BLOCK_PX)
    y = (_BLOCK_PX * down[drawn])[:, None, None] + block[:, None]
    x = (_BLOCK_PX * right[drawn])[:, None, None] + block
    y, x, of = np.broadcast_arrays(y, x, rows[row[drawn]][:, None, None])
    inside = (y < height) & (x < width)
    text = (
        f"{inside.sum()} pixels of {clip.camera.name} in blocks of {_BLOCK_PX} x {_BLOCK_PX}, "
        "kept out of training as no frame is held out"
    )
    return HeldOutPixels(of[inside], (y * width + x)[inside], text)


def _rim(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    radius = max(round(_RIM * max(mask.shape)), 1)
    kernel = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    return cv2.dilate(mask.astype(np.uint8), kernel) > 0


@dataclass(frozen=True, eq=False)
class HeldOutScore:
    """The rays of held-out pixels, ready to be rendered again and again."""

    scene: PosedScene  # at the moments of the pixels, with the weights that are being learned
    rays: Rays
    row: Tensor  # (P,) moment of each ray
    near: Tensor  # (P,) metres; nothing to be seen where far is 0
    far: Tensor
    rgb: NDArray[np.float32]  # (P, 3) what the camera saw
    background: Tensor  # (P, 3)

    @classmethod
    def prepare(
        cls, clip: Clip, held_out: HeldOutPixels, space: Space, field: SceneField
    ) -> HeldOutScore:
        """Prepare the scene at the moments of the pixels."""
        moments, row = np.unique(held_out.rows, return_inverse=True)
        scene = space.at(field, torch.from_numpy(clip.times[moments]))
        pixel = torch.from_numpy(held_out.pixels)
        rays, along = pixel_rays(clip.camera, pixel)
        depths = np.zeros((2, len(moments), clip.camera.width * clip.camera.height), np.float32)
        for moment in range(len(moments)):
            seen = scene.pixels(clip.camera, moment)
            depths[:, moment, seen.pixels.numpy()] = seen.nearest.numpy(), seen.farthest.numpy()
        near, far = torch.from_numpy(depths[:, row, held_out.pixels]) * along
        rgb = clip.frames.reshape(len(clip.frames), -1, 3)[held_out.rows, held_out.pixels]
        behind = clip.background.reshape(-1, 3)[held_out.pixels]
        return cls(
            scene,
            rays.to(field.device),
            torch.from_numpy(row).to(field.device),
            near.to(field.device),
            far.to(field.device),
            rgb.astype(np.float32) / 255.0,
            torch.from_numpy(behind.astype(np.float32) / 255.0).to(field.device),
        )

    @torch.no_grad()
    def __call__(self) -> float:
        """``train_psnr`` of the present weights, dB: over the background, no random numbers."""
        parts = [self._rendered(rows) for rows in self._chunks()]
        return psnr(torch.cat(parts).cpu().numpy(), self.rgb)

    def _chunks(self) -> tuple[Tensor, ...]:
        rows = torch.arange(len(self.rays), device=self.near.device)
        return rows.split(self.scene.rays_at_once)

    def _rendered(self, rows: Tensor) -> Tensor:
        return self.scene.render(
            self.rays.select(rows),
            self.row[rows],
            self.near[rows],
            self.far[rows],
            self.background[rows],
            torch.full((len(rows), self.scene.jitters), 0.5, device=rows.device),
        ).rgb
