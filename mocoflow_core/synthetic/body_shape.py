"""What kind of person: Anny's phenotype."""

from __future__ import annotations

from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart


class BodyShape(ConfigurationPart):
    """Anny's phenotype of an adult, each value in [0, 1]."""

    gender: float = Field(0.0, ge=0, le=1, description="0 male, 1 female.")
    age: float = Field(2 / 3, ge=2 / 3, le=1, description="2/3 a young adult, 1 an old one.")
    muscle: float = Field(0.5, ge=0, le=1, description="0.5 is average.")
    weight: float = Field(0.5, ge=0, le=1, description="0.5 is average.")
    height: float = Field(0.5, ge=0, le=1, description="0.5 is average.")
    proportions: float = Field(0.5, ge=0, le=1, description="0.5 is average.")
