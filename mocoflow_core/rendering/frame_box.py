"""The paper's adaptive box: where a frame's rays are sampled."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from safetensors.torch import load_file, save_file
from torch import Tensor

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.scene_field import interpolate_rows
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays, intersect_boxes

Follows = Literal["frame", "clip"]

_FILE = "boxes.safetensors"


class BoxConfig(ConfigurationPart):
    """Box and samples of preset ``paper``."""

    margin_xy_m: float = Field(0.2, ge=0, description="beyond the mesh across the view (paper)")
    margin_z_m: float = Field(
        0.4, ge=0, description="along the view, where the estimate knows least (paper)"
    )
    coarse_samples: int = Field(64, ge=1, description="of a ray, evenly spread (paper: 64)")
    fine_samples: int = Field(128, ge=1, description="of a ray, where density was found (paper)")


@dataclass(frozen=True, eq=False)
class FrameBoxes:
    """A box for each frame, with sides along the train camera's axes, whichever camera looks."""

    rotation: Tensor  # (3, 3) world -> axes of the boxes
    times: Tensor  # (F,) normalised, ascending
    lower: Tensor  # (F, 3) metres, in the boxes' axes
    upper: Tensor  # (F, 3)
    middles: Tensor  # (F, 3) of the frames' own meshes, in the boxes' axes

    def to(self, device: torch.device) -> FrameBoxes:
        parts = (self.rotation, self.times, self.lower, self.upper, self.middles)
        return FrameBoxes(*(part.to(device) for part in parts))

    def at(self, times: Tensor) -> FrameBoxes:
        """Boxes at any times (G,), linear between frames."""
        parts = (self.lower, self.upper, self.middles)
        return FrameBoxes(
            self.rotation, times, *(interpolate_rows(part, self.times, times) for part in parts)
        )

    def intersect(self, rays: Rays, row: Tensor) -> tuple[Tensor, Tensor]:
        """Entry and exit (R,) of each ray through its moment's box; far <= near where it misses."""
        turned = Rays(rays.origins @ self.rotation.T, rays.directions @ self.rotation.T)
        return intersect_boxes(turned, self.lower[row], self.upper[row])

    def middle(self, row: int) -> NDArray[np.float64]:
        """Middle of one frame's mesh, (3,) world metres, also where one box holds the clip."""
        return (self.middles[row] @ self.rotation).double().numpy()

    @property
    def mean_depth_m(self) -> float:
        """How long the boxes are along the view, on average."""
        return float((self.upper - self.lower)[:, 2].mean())

    def save(self, folder: Path) -> None:
        named = {name: part.contiguous() for name, part in vars(self).items()}
        save_file(named, folder / _FILE)

    @classmethod
    def load(cls, folder: Path) -> FrameBoxes:
        return cls(**load_file(folder / _FILE))


def frame_boxes(
    vertices: NDArray[np.float32],
    times: NDArray[np.float64],
    camera: Camera,
    configuration: BoxConfig,
    follows: Follows = "frame",
) -> FrameBoxes:
    """The axis-aligned box of each frame's mesh, enlarged.

    Args:
        vertices: (F, V, 3) world metres.
        times: (F,) normalised.
        camera: the train camera; Z is its viewing direction.
        follows: each frame's mesh, or the meshes of the whole clip with one box.

    Source: MoCo-Flow sec. 3.4.
    """
    turned = vertices.astype(np.float64) @ camera.R.T
    margin = np.array([configuration.margin_xy_m] * 2 + [configuration.margin_z_m])
    lower, upper = turned.min(1) - margin, turned.max(1) + margin
    middles = 0.5 * (lower + upper)
    if follows == "clip":
        lower[:], upper[:] = lower.min(0), upper.max(0)
    rotation, *parts = (
        torch.from_numpy(part).float() for part in (camera.R, lower, upper, middles)
    )
    return FrameBoxes(rotation, torch.from_numpy(times.astype(np.float64)), *parts)
