"""The base of every configuration part: frozen, typed, unknown fields refused."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class ConfigurationPart(BaseModel):
    """Immutable settings of one stage. Each part lives next to the code that reads it."""

    model_config = ConfigDict(frozen=True, extra="forbid")
