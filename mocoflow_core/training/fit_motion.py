"""Stage 2: motion fields that start at the mesh's own motion.

The body's motion is measured from the mesh sequence and spread into the space around it; how well
both directions then fit the mesh is written down, so that the plan can leave the paper's N1 steps
of fitting out with evidence.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import load_file, save_file

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rigid_controls import RigidControls, rigid_controls
from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.body_lattices import build_body_motion
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.scene_shape import MotionConfig
from mocoflow_core.progress import Progress, part_of, untold

# About the share of the time that goes into the look-up tables; the rest measures them.
BUILDING = 0.8


@dataclass(frozen=True)
class MotionFit:
    """How well the body's motion reproduces the mesh, before any learning; millimetres."""

    to_canonical_mm: float
    to_observed_mm: float
    round_trip_mm: float


@dataclass(frozen=True, eq=False)
class MotionStart:
    """The motion of the body: controls at all frames, look-up tables at the training frames."""

    controls: RigidControls
    body: BodyMotion
    fit: MotionFit

    def save(self, folder: Path) -> None:
        self.controls.save(folder)
        save_file(self.body.tensors(), folder / "body.safetensors")
        (folder / "fit.json").write_text(json.dumps(asdict(self.fit)))

    @classmethod
    def load(cls, folder: Path) -> MotionStart:
        return cls(
            RigidControls.load(folder),
            BodyMotion.from_tensors(load_file(folder / "body.safetensors")),
            MotionFit(**json.loads((folder / "fit.json").read_text())),
        )


def fit_motion(
    clip: Clip,
    meshes: MeshSequence,
    density: CanonicalDensity,
    shell_width_m: float,
    moves: bool,
    configuration: MotionConfig,
    progress: Progress = untold,
) -> MotionStart:
    """Measure the mesh's motion and build both directions of the motion field from it.

    Args:
        moves: false: the canonical body stands in every frame, and all frames share one table.

    Source: MoCo-Flow sec. 3.4, second stage; method notes, fast representation.
    """
    meshes = meshes.at(clip.frame_indices)
    if not moves:
        still = np.broadcast_to(density.vertices, meshes.vertices.shape)
        meshes = replace(meshes, vertices=still)
    body_configuration = configuration.body
    controls = rigid_controls(
        density.vertices,
        meshes.vertices,
        meshes.faces,
        clip.times,
        body_configuration.control_spacing_m,
        body_configuration.neighbours,
    )
    training = np.flatnonzero(~clip.held_out)
    different = training if moves else training[:1]
    body = build_body_motion(
        *(controls.frames(different), density.prior(), shell_width_m, body_configuration),
        progress=part_of(progress, 0.0, BUILDING),
    )
    measuring = part_of(progress, BUILDING, 1.0)
    fit = measure_fit(body, density.vertices, meshes.vertices[different], measuring)
    if not moves:
        body = body.at_times(torch.from_numpy(clip.times[training]))
    return MotionStart(controls, body, fit)


def measure_fit(
    body: BodyMotion,
    canonical: NDArray[np.float32],
    observed: NDArray[np.float32],
    progress: Progress = untold,
) -> MotionFit:
    """Mean distances between moved mesh vertices and where the mesh has them."""
    errors = []
    goal = torch.from_numpy(canonical)
    for row, vertices in enumerate(observed):
        points = torch.from_numpy(vertices)
        frame = torch.full((len(points),), row)
        mapped, _ = body.to_canonical(points, frame)
        placed, _ = body.to_observed(goal, frame)
        back, _ = body.to_observed(mapped, frame)
        errors.append([_mean_mm(mapped, goal), _mean_mm(placed, points), _mean_mm(back, points)])
        progress((row + 1) / len(observed), f"fit of frame {row + 1}")
    return MotionFit(*np.mean(errors, axis=0).tolist())


def _mean_mm(points: torch.Tensor, goal: torch.Tensor) -> float:
    return 1000.0 * float((points - goal).norm(dim=-1).mean())
