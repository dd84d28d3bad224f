"""The weights of the last steps, averaged: what a scene is shown with.

A step follows a few hundred rays, and the weights keep dancing around what all rays agree on. The
mean of the last steps lies closer to it. Training itself goes on from the last weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import torch
from torch import Tensor, nn


class AveragedWeights:
    """Exponential mean of a model's parameters over its steps.

    Source: Polyak and Juditsky 1992; the exponential form as in Tarvainen and Valpola 2017.
    """

    def __init__(self, model: nn.Module, decay: float) -> None:
        """Args: how much of the mean each step keeps; 0: the last weights themselves."""
        self.decay = decay
        self.steps = 0
        named = model.named_parameters() if decay > 0 else ()
        self._learned = {name: value for name, value in named if value.requires_grad}
        self._means = self._copies()

    @torch.no_grad()
    def update(self) -> None:
        """Take in the weights after a step. Early means are short: the start is no part of them."""
        self.steps += 1
        if self.steps == 1:
            self.restart()
        kept = min(self.decay, self.steps / (self.steps + 9.0))
        for mean, value in zip(self._means, self._learned.values(), strict=True):
            mean.lerp_(value, 1.0 - kept)

    def restart(self) -> None:
        """Forget all earlier weights: the present ones are the mean."""
        self._means = self._copies()

    def state(self) -> dict[str, Tensor]:
        """The means by the names of their parameters, for a checkpoint."""
        return dict(zip(self._learned, self._means, strict=True))

    def restore(self, means: Mapping[str, Tensor], steps: int) -> None:
        """Go on as the average whose ``state`` and ``steps`` these are."""
        self.steps = steps
        self._means = [means[name].to(own).clone() for name, own in self._learned.items()]

    def take(self) -> None:
        """Give the model its means for good."""
        self._write(self._means)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Inside, the model has its means; after that its own weights again."""
        own = self._copies()
        self.take()
        try:
            yield
        finally:
            self._write(own)

    @torch.no_grad()
    def _write(self, values: list[Tensor]) -> None:
        for parameter, value in zip(self._learned.values(), values, strict=True):
            parameter.copy_(value)

    def _copies(self) -> list[Tensor]:
        return [value.detach().clone() for value in self._learned.values()]
