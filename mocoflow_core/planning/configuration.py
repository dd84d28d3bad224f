"""Thresholds of the decisions, and the user's last word on each."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from mocoflow_core.body.light import LightConfig
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.planning.decision import Force


class PlanConfig(ConfigurationPart):
    """Thresholds of the decisions; each decision can be forced on or off."""

    background_extraction: Force = "auto"
    mask_segmentation: Force = "auto"
    location_search: Force = "auto"
    repeated_frames: Force = "auto"
    body_repair: Force = "auto"
    motion_fields: Force = "auto"
    motion_residual: Force = "auto"
    motion_consensus: Force = "auto"
    appearance_codes: Force = "auto"
    fixed_light: Force = "auto"
    wide_shell: Force = "auto"
    fine_detail: Force = "auto"
    initialisation: Force = "auto"
    adaptive_box: Force = "auto"
    canonical_frame: Literal["most_spread", "first"] = Field(
        "most_spread", description="Whose observation space is canonical (paper: the first)."
    )
    trusted_overlap: float = Field(
        0.6, ge=0, le=1, description="Silhouette overlap from which a given location is trusted."
    )
    faint_shadow: float = Field(
        0.05, ge=0, description="Moving shadows up to this share of the person's area are faint."
    )
    still_px: float = Field(
        0.5, ge=0, description="A body whose points move less than this, in pixels, is still."
    )
    # Up to there a residual motion gained 0.1 dB and doubled a step: benchmarks/decisions.md.
    consistent_m: float = Field(
        0.09, ge=0, description="Outlines nearer than this, in metres, leave nothing to correct."
    )
    constant_brightness: float = Field(
        0.02, ge=0, description="Brightness of the person that changes less than this is constant."
    )
    light: LightConfig = LightConfig()
    faint_light: float = Field(
        0.05, ge=0, description="A light that changes brightness by less than this is left out."
    )
    tight_box: float = Field(
        1.2, ge=1, description="A box for the whole clip so much larger than each frame's is tight."
    )
    detail_px: float = Field(
        0.5, gt=0, description="Cells and steps below this part of a pixel show nothing more."
    )
    fine_m: float = Field(
        0.01, gt=0, description="Cells and steps are so fine where pixels can show it, metres."
    )
    shell_margin_m: float = Field(
        0.02, ge=0, description="Room around what the masks show, for the edge of the density."
    )
    narrowest_shell_m: float = Field(0.03, gt=0, description="Least shell around the body, metres.")
    widest_shell_m: float = Field(0.15, gt=0, description="Largest shell around the body, metres.")
