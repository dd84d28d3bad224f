"""The motion is fitted to the mesh before the pixels: L_fit of the paper."""

from __future__ import annotations

import torch
from torch import Tensor


def correspondence(moved: Tensor, partners: Tensor) -> Tensor:
    """Distance of moved points (P, 3) from where the mesh has them, L1 over axes, mean, metres.

    No points give exactly 0. Source: MoCo-Flow sec. 3.4, the first two terms of L_fit.
    """
    return (moved - partners).abs().sum() / max(len(moved), 1)


def free_space(density: Tensor, step_m: float) -> Tensor:
    """Mean binary cross-entropy of the opacity of one step at points (P,) where nothing may be.

    The opacity is ``1 - exp(-density step)``, so its cross-entropy against 0 is ``density step``,
    without a logarithm that saturates. No points give exactly 0. Source: MoCo-Flow sec. 3.4, the
    third term of L_fit.
    """
    return torch.sum(density) * step_m / max(len(density), 1)
