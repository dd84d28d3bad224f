"""How strongly each loss pulls. A weight of zero leaves its loss out and saves its cost."""

from __future__ import annotations

from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart


class LossConfig(ConfigurationPart):
    """Weights of the losses; lengths are metres."""

    consensus_weight: float = Field(0.2, ge=0, description="motion consensus (paper: 0.2)")
    global_share: float = Field(1.0, ge=0, description="of the global term; 0: without global")
    local_share: float = Field(1.0, ge=0, description="of the local term; 0: without local")
    density_threshold: float = Field(0.01, ge=0, description="consensus above it, 1/m (paper)")
    consensus_points: int | None = Field(
        512, ge=1, description="samples that the consensus looks at; null: all (paper)"
    )
    fit_weight: float = Field(10.0, ge=0, description="motion fitted to the mesh (paper: 10)")
    fit_points: int = Field(512, ge=1, description="points on the body, and in free space, a step")
    free_margin_m: float = Field(
        0.05, ge=0, description="free space is farther from the mesh than this"
    )
    free_step_m: float = Field(
        0.02, gt=0, description="free space: length over which opacity is taken"
    )
    silhouette_weight: float = Field(0.1, ge=0, description="opacity against the mask")
    offset_weight: float = Field(1.0, ge=0, description="squared offset from the mesh's surface")
    residual_weight: float = Field(1.0, ge=0, description="squared correction of the body's motion")
    smoothness_weight: float = Field(10.0, ge=0, description="squared change between frames")
    appearance_weight: float = Field(1e-3, ge=0, description="squared appearance codes")
