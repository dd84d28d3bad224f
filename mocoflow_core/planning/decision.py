"""One decision about what a scene needs, with the evidence for it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, field_validator

Force = Literal["auto", "on", "off"]
Part = Literal["preparation", "optimisation", "scoring"]


class Decision(BaseModel):
    """Whether something is needed, why, and what leaving it out saves."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    part: Part
    needed: bool
    reason: str
    evidence: dict[str, float] = {}
    threshold: float | None = None
    saves: str = ""

    @field_validator("evidence")
    @classmethod
    def _known(cls, evidence: dict[str, float]) -> dict[str, float]:
        """What could not be measured is left out: JSON has no word for it."""
        return {name: value for name, value in evidence.items() if math.isfinite(value)}

    def forced(self, force: Force) -> Decision:
        """The same decision after the configuration has had its say."""
        if force == "auto":
            return self
        reason = f"forced {force} by the configuration; measured: {self.reason}"
        return self.model_copy(update={"needed": force == "on", "reason": reason})


def with_evidence(
    decisions: Iterable[Decision], name: str, measured: Mapping[str, float]
) -> tuple[Decision, ...]:
    """The decisions, the named one with what was measured while it was carried out."""
    return tuple(
        decision.model_copy(update={"evidence": decision.evidence | dict(measured)})
        if decision.name == name
        else decision
        for decision in decisions
    )
