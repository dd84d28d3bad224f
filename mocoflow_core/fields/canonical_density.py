"""The canonical mesh and its signed distance, as the first stage leaves them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file

from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior

_FILE = "density.safetensors"


@dataclass(frozen=True, eq=False)
class CanonicalDensity:
    """The canonical mesh and its signed distance; canonical space is the world at that frame."""

    vertices: NDArray[np.float32]  # (V, 3) metres
    faces: NDArray[np.int32]  # (F, 3)
    lattice: NDArray[np.float32]  # (X, Y, Z) metres, negative inside
    origin: NDArray[np.float32]  # (3,)
    spacing: float

    def prior(self) -> SignedDistancePrior:
        return SignedDistancePrior(
            torch.from_numpy(self.lattice), torch.from_numpy(self.origin), self.spacing
        )

    def save(self, folder: Path) -> None:
        names = ("vertices", "faces", "lattice", "origin")
        arrays = {name: np.ascontiguousarray(getattr(self, name)) for name in names}
        arrays["spacing"] = np.array([self.spacing])
        save_file(arrays, folder / _FILE)

    @classmethod
    def load(cls, folder: Path) -> CanonicalDensity:
        arrays = load_file(folder / _FILE)
        return cls(**(arrays | {"spacing": float(arrays["spacing"][0])}))  # type: ignore[arg-type]
