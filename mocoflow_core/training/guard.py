"""No NaN survives and no run goes astray unseen.

A bad step is refused, the last good state restored, the rates cut.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median

import torch
from torch import Tensor, nn

# Losses vary with the rays and the frames that are drawn. What counts is the median of the last
# steps, at least so many of them, of rays and of frames.
_RECENT_STEPS = 10
_FEWEST_STEPS = 5
_RECENT_RAYS = 1000
_RECENT_FRAMES = 40
# A rise above the best by the first factor is met at once, by the second when a state is to be
# kept: a scene in which nothing is left to see costs two to four times the losses of its start.
# Once losses have risen, the second is met at once as well: first steps at up to four times the
# usual rates stay below it, those at ten times do not.
_ASTRAY = 4.0
_WORSE = 2.0
# Below this (30 dB of a colour) a rise is no harm.
_SMALL_LOSS = 1e-3
# What the rates are multiplied with when a step is refused. Numbers that are not finite may come
# from a single frame. Losses that have risen say that the rates are too high, and mostly by far:
# too low ones leave the start as it is, too high ones end in something worse.
_CUT = 0.5
_CUT_AFTER_RISE = 0.125


class TrainingDiverged(RuntimeError):
    """The optimisation met more bad steps than it may recover from."""


@dataclass(frozen=True)
class GuardEvent:
    """One refused step."""

    step: int
    what: str
    rates: float = _CUT  # what they were multiplied with


class Guard:
    """Watches losses, gradients and weights; keeps the last good state to go back to."""

    def __init__(
        self,
        model: nn.Module,
        optimiser: torch.optim.Optimizer,
        allowed: int,
        rays: int = _RECENT_RAYS,
        frames: int = _RECENT_FRAMES,
    ) -> None:
        """Args: allowed events before the run stops, rays and frames of one step."""
        self.model = model
        self.optimiser = optimiser
        self.allowed = allowed
        self.events: list[GuardEvent] = []
        self.rate_scale = 1.0
        steps = max(_RECENT_STEPS, -(-_RECENT_RAYS // rays), -(-_RECENT_FRAMES // frames))
        self.recent: deque[float] = deque(maxlen=steps)
        self.best = math.inf
        bad = self._not_finite() or self._moment_not_finite()
        if bad is not None:
            raise TrainingDiverged(
                f"cannot start: {bad} is not finite. Remove the checkpoint and start again."
            )
        self.remember()

    def expect(self, loss: float) -> None:
        """What the losses sum to at the start, over many rays."""
        self.best = loss if math.isfinite(loss) else math.inf

    def good_state(self) -> dict[str, Tensor]:
        """The last good weights and moments by name, for a checkpoint."""
        named = list(self.model.named_parameters())
        state = {f"weight/{n}": good for (n, _), good in zip(named, self._weights, strict=True)}
        for name, parameter in named:
            for part, value in self._moments.get(parameter, {}).items():
                if isinstance(value, Tensor):
                    state[f"moment/{name}/{part}"] = value
        return state

    def restore(self, good: Mapping[str, Tensor], best: float, recent: Iterable[float]) -> None:
        """Go on as the guard whose ``good_state``, ``best`` and ``recent`` these are."""
        self.best = best
        self.recent.extend(recent)
        named = dict(self.model.named_parameters())
        self._weights = [good[f"weight/{name}"] for name in named]
        self._moments: dict[Tensor, dict[str, object]] = {}
        for key, value in good.items():
            kind, name, *part = key.split("/")
            if kind == "moment":
                owner = named[name]
                self._moments.setdefault(owner, {})[part[0]] = value.to(owner.device)

    def remember(self) -> None:
        """Take the present state as good, unless it is not finite."""
        if self._not_finite() is None and self._moment_not_finite() is None:
            self._weights = [value.detach().clone() for value in self.model.parameters()]
            self._moments = {
                parameter: {name: _copied(value) for name, value in state.items()}
                for parameter, state in self.optimiser.state.items()
            }

    def settle(self) -> str | None:
        """Remember the present state if the last steps prove it good; else their decline."""
        enough = len(self.recent) == self._window
        decline = self.decline() if enough else None
        if enough and decline is None:
            self.best = min(self.best, median(self.recent))
            self.remember()
        return decline

    def decline(self) -> str | None:
        """Whether the last steps are worse than the best ones, or too few since a refusal."""
        if len(self.recent) >= _FEWEST_STEPS:
            return self._risen(_WORSE)
        if self.events and self.recent:
            return f"only {len(self.recent)} steps since the last refusal: too few to trust"
        return None

    def problem(self, terms: dict[str, Tensor]) -> str | None:
        """What is wrong with a step, in words; None if all is well.

        The first loss, weight or gradient that is not finite, or losses that have risen far above
        the best ones. Without terms the state alone is looked at.
        """
        for name, value in terms.items():
            if not torch.isfinite(value.detach()):
                return f"loss {name} is {value.item()}"
        bad = self._not_finite()
        if bad is not None:
            return f"{bad} is not finite"
        known = len(self.recent)
        if terms:
            self.recent.append(sum(float(value.detach()) for value in terms.values()))
        if len(self.recent) < self._window:
            return None
        rise = self._risen(_WORSE if self._cautious else _ASTRAY)
        return rise or (self._on_trial() if known < self._window else None)

    @property
    def _window(self) -> int:
        """How many losses tell of a rise."""
        assert self.recent.maxlen is not None
        return self.recent.maxlen

    def _on_trial(self) -> str | None:
        """The first losses after a rise that have not risen again only tell which rates hold.

        What barely holds has done harm already, and should be kept a distance from.
        """
        if self.events and self.events[-1].rates < _CUT:
            return "the losses hold at last: again, at rates that are well below"
        return None

    @property
    def _cautious(self) -> bool:
        """Whether the rates have proven too high: the next rise is met earlier."""
        return any(event.rates < _CUT for event in self.events)

    def _risen(self, factor: float) -> str | None:
        usual = median(self.recent) if self.recent else 0.0
        if usual <= factor * max(self.best, _SMALL_LOSS):
            return None
        return f"the losses have risen from {self.best:.3g} to {usual:.3g}: rates too high?"

    def _moment_not_finite(self) -> str | None:
        """The first moment of the optimiser that is not finite."""
        for name, parameter in self.model.named_parameters():
            for part, value in self.optimiser.state.get(parameter, {}).items():
                if isinstance(value, Tensor) and not torch.isfinite(value).all():
                    return f"the optimiser's {part} of {name}"
        return None

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
        """Go back to the last good state with lower rates: half, or less where losses have risen.

        Raises:
            TrainingDiverged: after more than the allowed number of events.
        """
        rose = len(self.recent) >= _FEWEST_STEPS and self._risen(_WORSE) is not None
        cut = _CUT_AFTER_RISE if rose else _CUT
        self.events.append(GuardEvent(step, what, cut))
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
        self.rate_scale *= cut
        self.recent.clear()


def _copied(value: object) -> object:
    return value.detach().clone() if isinstance(value, Tensor) else value
