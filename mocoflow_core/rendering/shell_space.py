"""Where the body is at any time, for the fast representation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.body.rigid_controls import RigidControls
from mocoflow_core.fields.body_lattices import build_body_motion, canonical_nodes
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.rendering.canonical_scene import ShellCanonical
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.rendering.shell_scene import ShellScene


class ShellSpace:
    """The canonical mesh, the motion of its controls, and look-up tables made from both."""

    def __init__(
        self, shape: SceneShape, density: CanonicalDensity, controls: RigidControls
    ) -> None:
        self.shape = shape
        self.density = density
        self.controls = controls
        self.sampling = SamplingConfig(step_m=shape.step_m, inner_depth_m=shape.inner_depth_m)
        self._prior = density.prior()
        self._canonical = canonical_nodes(controls, shape.shell_width_m, shape.motion.body)
        self._bodies: dict[tuple[float, ...], BodyMotion] = {}

    @property
    def canonical_vertices(self) -> NDArray[np.float32]:
        return self.density.vertices

    def build(self) -> HybridField:
        return self.shape.build(self.density.prior())

    def at(self, field: HybridField, times: Tensor) -> ShellScene:
        """The scene at normalised times (G,); a tenth of a second for each new moment."""
        wanted = tuple(times.tolist())
        if wanted not in self._bodies:
            self._bodies[wanted] = build_body_motion(
                self.controls.at_times(times.double().numpy()),
                self._prior,
                self.shape.shell_width_m,
                self.shape.motion.body,
                self._canonical,
            )
        body = self._bodies[wanted]
        return ShellScene(field, body, self.shape.shell_width_m, self.sampling, times)

    def at_training_frames(self, field: HybridField, body: BodyMotion) -> ShellScene:
        """The scene at the training frames, whose tables were made when the motion was fitted."""
        return ShellScene(field, body, self.shape.shell_width_m, self.sampling)

    def canonical(self, field: HybridField) -> ShellCanonical:
        return ShellCanonical(field, self.canonical_vertices, self.shape.shell_width_m)

    def centre_at(self, time: float) -> NDArray[np.float64]:
        """Mean of the body's control points, (3,) world metres."""
        return self.controls.at_time(time).observed[0].mean(axis=0).astype(np.float64)

    def save(self, folder: Path) -> None:
        (folder / "shape.json").write_text(self.shape.model_dump_json(indent=1))
        self.density.save(folder)
        self.controls.save(folder)

    @classmethod
    def load(cls, folder: Path) -> ShellSpace:
        shape = SceneShape.model_validate_json((folder / "shape.json").read_text())
        return cls(shape, CanonicalDensity.load(folder), RigidControls.load(folder))
