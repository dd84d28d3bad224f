"""A body mesh with constant topology, posed at each frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class MeshSequence:
    """Vertices per frame, joined to the frames by their source number.

    Once ingested and located, the vertices are in **world metres**.
    """

    frame_indices: NDArray[np.int32]  # (T,) source frame numbers, ascending
    vertices: NDArray[np.float32]  # (T, V, 3) metres
    faces: NDArray[np.int32]  # (F, 3)
    keypoint_regressor: NDArray[np.float32] | None = None  # (17, V), rows sum to one

    def at(self, frame_indices: NDArray[np.int32]) -> MeshSequence:
        """The meshes of the given source frames, which must all be present."""
        position = {int(index): row for row, index in enumerate(self.frame_indices)}
        rows = [position[int(index)] for index in frame_indices]
        return MeshSequence(
            np.asarray(frame_indices, np.int32),
            self.vertices[rows],
            self.faces,
            self.keypoint_regressor,
        )

    def save(self, path: Path) -> None:
        arrays = {
            "frame_indices": self.frame_indices,
            "vertices": self.vertices,
            "faces": self.faces,
        }
        if self.keypoint_regressor is not None:
            arrays["keypoint_regressor"] = self.keypoint_regressor
        with path.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: Path) -> MeshSequence:
        with np.load(path, allow_pickle=False) as arrays:
            regressor = arrays["keypoint_regressor"] if "keypoint_regressor" in arrays else None
            return cls(arrays["frame_indices"], arrays["vertices"], arrays["faces"], regressor)
