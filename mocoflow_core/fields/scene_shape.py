"""What fixes the shape of a scene's fields: their configuration and what the mesh gives."""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field
from torch import Tensor

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.body_lattices import BodyMotionConfig
from mocoflow_core.fields.canonical_grid import CanonicalConfig, CanonicalGrid, nested_grids
from mocoflow_core.fields.hybrid_field import HybridField
from mocoflow_core.fields.lighting import FixedLight
from mocoflow_core.fields.motion_hybrid import HybridMotion
from mocoflow_core.fields.motion_residual import ResidualConfig
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior


class MotionConfig(ConfigurationPart):
    """The hybrid motion: the body's own and the residual on top."""

    body: BodyMotionConfig = BodyMotionConfig()
    residual: ResidualConfig = ResidualConfig()


class SceneShape(ConfigurationPart):
    """Everything besides the weights that is needed to build a scene's fields again."""

    representation: Literal["hybrid"] = "hybrid"
    canonical: CanonicalConfig
    motion: MotionConfig
    times: tuple[float, ...] = Field(description="training frames, normalised")
    shell_width_m: float = Field(gt=0)
    inner_depth_m: float = Field(gt=0)
    step_m: float = Field(gt=0, description="distance between samples")
    residual: bool = Field(True, description="whether the body's motion is corrected at all")
    light: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0), description="linear brightness is 1 + light . normal, world space"
    )

    def build(self, prior: SignedDistancePrior) -> HybridField:
        """Fields with fresh weights, drawn from torch's global generator."""
        outside = self.shell_width_m + self.canonical.margin_m
        grids = nested_grids(prior, outside, self.inner_depth_m, self.canonical)
        centre, radius = _middle(prior)
        times = torch.tensor(self.times, dtype=torch.float64)
        motion = HybridMotion(times, centre, radius, self.motion.residual)
        motion.corrects = self.residual
        light = FixedLight(self.light)
        return HybridField(times, motion, CanonicalGrid(prior, grids, self.canonical, light))


def _middle(prior: SignedDistancePrior) -> tuple[Tensor, float]:
    """Centre and half the longest side of the lattice's box: coordinates fall into [-1, 1]."""
    side = prior.spacing * (torch.tensor(prior.lattice.shape) - 1)
    return prior.origin + 0.5 * side, float(0.5 * side.max())
