"""How a body's location is searched."""

from __future__ import annotations

from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart


class LocationConfig(ConfigurationPart):
    """How finely the location is searched, and how smooth it is in time."""

    spans: tuple[float, ...] = Field(
        (0.4, 0.15, 0.05), description="Each level tries depths up to this share nearer or farther."
    )
    depths: int = Field(5, ge=3, description="Depths tried on each level.")
    grid_px: int = Field(96, ge=16, description="Side of the crop the grid is searched on, pixels.")
    outline_px: int = Field(
        320, ge=32, description="Side of the crop the outline is fitted on, pixels."
    )
    crop_pad: float = Field(
        1.5, ge=1, description="Side of the crops, times the longer side of the mask's box."
    )
    outline_iterations: int = Field(8, ge=0, description="Most steps of the outline fit.")
    usual_offset_m: float = Field(
        0.02, gt=0, description="How far clothes or wide masks usually move an outline, metres."
    )
    least_overlap: float = Field(
        0.4, ge=0, lt=1, description="Frames that overlap less say nothing of the location."
    )
    cut_power: float = Field(
        4.0, ge=0, description="Confidence falls with this power of the share of the body in sight."
    )
    least_gain: float = Field(
        0.5,
        ge=0,
        lt=1,
        description="Share of a given place's mismatch that another must take off; 0: it is left.",
    )
    doubtful: float = Field(
        0.05, ge=0, lt=1, description="Frames of less confidence are told of in a warning."
    )
    depth_noise_m: float = Field(0.03, gt=0, description="Usual error of a frame's depth, metres.")
    lateral_noise_m: float = Field(
        0.005, gt=0, description="Usual error of a frame's lateral position, metres."
    )
    acceleration_m_s2: float = Field(
        4.0, gt=0, description="Usual acceleration of the body's centre, metres per square second."
    )

    def where_asked_for(self) -> LocationConfig:
        """For a search that was asked for by hand: what it finds is taken."""
        return self.model_copy(update={"least_gain": 0.0})
