"""A scene at given moments, whatever it is made of: what rays see there, where points go."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays
from mocoflow_core.rendering.canonical_scene import CanonicalScene
from mocoflow_core.rendering.pixels import VisiblePixels
from mocoflow_core.rendering.sampling import PackedSamples


@dataclass(frozen=True, eq=False)
class RenderedRays:
    """What R rays see, and the S samples behind it."""

    rgb: Tensor  # (R, 3) composited over the background
    opacity: Tensor  # (R,)
    samples: PackedSamples
    density: Tensor  # (S,) per metre


class PosedScene(Protocol):
    """A scene at G moments, its rows."""

    jitters: int  # random numbers that one ray takes
    rays_at_once: int  # that fit into memory

    def pixels(self, camera: Camera, row: int) -> VisiblePixels:
        """Pixels that can show the person at one moment, and between which depths."""

    def render(
        self,
        rays: Rays,
        row: Tensor,
        near: Tensor,
        far: Tensor,
        background: Tensor,
        jitter: Tensor,
    ) -> RenderedRays:
        """Render R rays.

        Args:
            rays: R rays in world space.
            row: (R,) moment of each ray.
            near, far: (R,) metres between which the person can be; nothing where far <= near.
            background: (R, 3) colour behind the person, seen through what opacity leaves.
            jitter: (R, jitters) in [0, 1); 0.5 everywhere at evaluation.
        """

    def to_canonical(self, points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        """Observed points (P, 3) of moments (P,), world metres, to canonical space.

        And where (P,) the motion is known. The paper's M^bw.
        """

    def to_observed(self, points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        """Canonical points (P, 3) to the space of their moments; the paper's M^fw."""


Field = TypeVar("Field", bound=SceneField)


class Space(Protocol[Field]):
    """What a representation knows of a scene besides the weights: shapes, and the body's place."""

    @property
    def canonical_vertices(self) -> NDArray[np.float32]:
        """The mesh at the canonical frame, (V, 3) world metres."""

    def build(self) -> Field:
        """Fields with fresh weights, drawn from torch's global generator."""

    def at(self, field: Field, times: Tensor) -> PosedScene:
        """The scene at normalised times (G,); what they need is prepared once and kept."""

    def canonical(self, field: Field) -> CanonicalScene:
        """The scene at no moment: density and colour of canonical space."""

    def centre_at(self, time: float) -> NDArray[np.float64]:
        """About the middle of the body at a normalised time, (3,) world metres."""

    def save(self, folder: Path) -> None:
        """Write all of it; ``rendering/trained_scene.py`` opens it again."""
