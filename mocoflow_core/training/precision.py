"""Which numbers the networks' products of a step are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from mocoflow_core.training.batches import Batch
from mocoflow_core.training.objective import Objective

Precision = Literal["float32", "bfloat16"]
_SHORT_TYPES = {"bfloat16": torch.bfloat16}


@dataclass(frozen=True)
class ShortProducts:
    """The same losses, their products of matrices in a shorter type; weights and sums stay long."""

    objective: Objective
    device: torch.device
    short: torch.dtype

    def __call__(self, batch: Batch, generator: torch.Generator) -> dict[str, Tensor]:
        with torch.autocast(self.device.type, self.short):
            return self.objective(batch, generator)


def in_precision(objective: Objective, precision: Precision, device: torch.device) -> Objective:
    """The losses as they are in float32, or else under autocast."""
    if precision == "float32":
        return objective
    return ShortProducts(objective, device, _SHORT_TYPES[precision])
