"""Where the body is at any time, for the paper's representation: its boxes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file
from torch import Tensor

from mocoflow_core.fields.network_field import NetworkField
from mocoflow_core.fields.network_shape import NetworkShape
from mocoflow_core.rendering.box_scene import BoxScene
from mocoflow_core.rendering.canonical_scene import BoxCanonical
from mocoflow_core.rendering.frame_box import FrameBoxes

_FILE = "canonical.safetensors"


class BoxSpace:
    """The networks' shape, the canonical mesh, and all frames' boxes, held-out ones included."""

    def __init__(
        self, shape: NetworkShape, boxes: FrameBoxes, canonical_vertices: NDArray[np.float32]
    ) -> None:
        self.shape = shape
        self.boxes = boxes
        self._vertices = canonical_vertices

    @property
    def canonical_vertices(self) -> NDArray[np.float32]:
        return self._vertices

    def build(self) -> NetworkField:
        return self.shape.build()

    def at(self, field: NetworkField, times: Tensor) -> BoxScene:
        shape = self.shape
        return BoxScene(field, self.boxes.at(times), shape.coarse_samples, shape.fine_samples)

    def canonical(self, field: NetworkField) -> BoxCanonical:
        half_longest_m = 0.5 * float(np.ptp(self._vertices, axis=0).max())
        step_m = self.boxes.mean_depth_m / self.shape.coarse_samples
        return BoxCanonical(field, self._vertices, self.shape.radius_m - half_longest_m, step_m)

    def centre_at(self, time: float) -> NDArray[np.float64]:
        """Middle of the box, (3,) world metres."""
        return self.boxes.at(torch.tensor([time], dtype=torch.float64)).middle(0)

    def save(self, folder: Path) -> None:
        (folder / "shape.json").write_text(self.shape.model_dump_json(indent=1))
        self.boxes.save(folder)
        save_file({"vertices": np.ascontiguousarray(self._vertices)}, folder / _FILE)

    @classmethod
    def load(cls, folder: Path) -> BoxSpace:
        shape = NetworkShape.model_validate_json((folder / "shape.json").read_text())
        return cls(shape, FrameBoxes.load(folder), load_file(folder / _FILE)["vertices"])
