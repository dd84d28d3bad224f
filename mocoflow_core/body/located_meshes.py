"""Bodies whose place was found, with what is known of each frame's place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LocatedMeshes:
    """Meshes in world metres, at every source frame, and how sure their location is."""

    meshes: MeshSequence
    translations: Array  # (T, 3) metres, what was added in the train camera's axes
    residual: Array  # (T,) 1 - overlap of the frame's own best placement; nan where not searched
    confidence: Array  # (T,) 0 where the location is interpolated
    mismatch: float  # mean share of masks and bodies where only one is, at the places found
    given_mismatch: float  # the same where they were given; inf without such a place
    adopted: bool  # whether the meshes stand there, or where they were given
    warnings: tuple[str, ...]

    @property
    def quality(self) -> dict[str, float]:
        """Of the places found, whether or not they were adopted, and of the given ones.

        Median residual, median and least confidence over the frames that were searched.
        """
        given = {"given_mismatch": self.given_mismatch}
        searched = np.isfinite(self.residual)
        sure = self.confidence[searched]
        return {
            "residual": float(np.median(self.residual[searched])),
            "confidence": float(np.median(sure)),
            "least_confidence": float(sure.min()),
            "mismatch": self.mismatch,
            **(given if math.isfinite(self.given_mismatch) else {}),
            "adopted": float(self.adopted),
        }

    def save(self, folder: Path) -> None:
        """Write ``meshes.npz`` and ``location.npz`` into an existing folder."""
        self.meshes.save(folder / "meshes.npz")
        with (folder / "location.npz").open("wb") as file:
            np.savez(
                file,
                translations=self.translations,
                residual=self.residual,
                confidence=self.confidence,
                mismatch=self.mismatch,
                given_mismatch=self.given_mismatch,
                adopted=self.adopted,
                warnings=np.array(self.warnings, dtype=np.str_),
            )

    @classmethod
    def load(cls, folder: Path) -> LocatedMeshes:
        """Inverse of ``save``."""
        with np.load(folder / "location.npz", allow_pickle=False) as arrays:
            return cls(
                MeshSequence.load(folder / "meshes.npz"),
                arrays["translations"],
                arrays["residual"],
                arrays["confidence"],
                float(arrays["mismatch"]),
                float(arrays["given_mismatch"]),
                bool(arrays["adopted"]),
                tuple(str(warning) for warning in arrays["warnings"]),
            )
