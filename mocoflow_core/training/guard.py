"""No NaN survives: a bad step is refused, the last good state restored, the rate halved."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn


class TrainingDiverged(RuntimeError):
    """The optimisation met more non-finite steps than it may recover from."""


@dataclass(frozen=True)
class GuardEvent:
    """One refused step."""

    step: int
    what: str


class Guard:
    """Watches losses, gradients and weights; keeps the last good state to go back to."""

    def __init__(self, model: nn.Module, optimiser: torch.optim.Optimizer, allowed: int) -> None:
        self.model = model
        self.optimiser = optimiser
        self.allowed = allowed
        self.events: list[GuardEvent] = []
        self.rate_scale = 1.0
        bad = self._not_finite()
        if bad is not None:
            raise TrainingDiverged(
                f"cannot start: {bad} is not finite. Remove the checkpoint and start again."
            )
        self.remember()

    def remember(self) -> None:
        """Take the present state as good, unless it is not finite."""
        if self._not_finite() is None:
            self._weights = [value.detach().clone() for value in self.model.parameters()]
            self._moments = {
                parameter: {name: _copied(value) for name, value in state.items()}
                for parameter, state in self.optimiser.state.items()
            }

    def problem(self, terms: dict[str, Tensor]) -> str | None:
        """Name of the first non-finite loss, weight or gradient; None if all is well."""
        for name, value in terms.items():
            if not torch.isfinite(value.detach()):
                return f"loss {name} is {value.item()}"
        bad = self._not_finite()
        return None if bad is None else f"{bad} is not finite"

    def _not_finite(self) -> str | None:
        """The first weight or gradient that is not finite."""
        named = [(f"weight {n}", p.detach()) for n, p in self.model.named_parameters()]
        named += [
            (f"gradient of {n}", p.grad)
            for n, p in self.model.named_parameters()
            if p.grad is not None
        ]
        norms = torch._foreach_norm([value for _, value in named])
        if torch.isfinite(torch.stack(norms)).all():
            return None
        return next(n for (n, _), norm in zip(named, norms, strict=True) if not norm.isfinite())

    def refuse(self, step: int, what: str) -> None:
        """Go back to the last good state and halve the rate.

        Raises:
            TrainingDiverged: after more than the allowed number of events.
        """
        self.events.append(GuardEvent(step, what))
        if len(self.events) > self.allowed:
            raise TrainingDiverged(
                f"stopped at step {step} after {len(self.events)} refused steps; the last: {what}. "
                "Lower schedule.rate_features and schedule.rate_networks, or look at the frames "
                "and meshes around the events listed in the report."
            )
        with torch.no_grad():
            for parameter, good in zip(self.model.parameters(), self._weights, strict=True):
                parameter.copy_(good)
            # What had no moments yet has none again.
            self.optimiser.state.clear()
            for owner, moments in self._moments.items():
                self.optimiser.state[owner] = {n: _copied(v) for n, v in moments.items()}
        self.rate_scale *= 0.5


def _copied(value: object) -> object:
    return value.detach().clone() if isinstance(value, Tensor) else value
