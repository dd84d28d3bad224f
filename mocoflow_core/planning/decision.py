"""One decision about what a scene needs, with the evidence for it."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

Force = Literal["auto", "on", "off"]


class Decision(BaseModel):
    """Whether something is needed, why, and what leaving it out saves."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    needed: bool
    reason: str
    evidence: dict[str, float] = {}
    threshold: float | None = None
    saves: str = ""

    def forced(self, force: Force) -> Decision:
        """The same decision after the configuration has had its say."""
        if force == "auto":
            return self
        reason = f"forced {force} by the configuration; measured: {self.reason}"
        return self.model_copy(update={"needed": force == "on", "reason": reason})
