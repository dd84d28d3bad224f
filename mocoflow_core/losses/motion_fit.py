"""The motion fields against the mesh: the paper's L_fit."""

from __future__ import annotations

from torch import Tensor


def correspondence_fit(moved: Tensor, target: Tensor) -> Tensor:
    """``|to_canonical(x_h) - x'_h|`` or its reverse; L1 over axes, mean over points, metres.

    Source: MoCo-Flow sec. 3.4.
    """
    return (moved - target).abs().sum(-1).mean()


def free_space(density: Tensor, step_m: float) -> Tensor:
    """Cross entropy of one step's opacity against 0 in free space, mean over points.

    With ``alpha = 1 - exp(-density step)`` it is exactly ``density * step``: no logarithm of a
    saturated opacity, no exploding gradient. Source: MoCo-Flow sec. 3.4; see docs/paper-map.md.
    """
    return density.mean() * step_m
