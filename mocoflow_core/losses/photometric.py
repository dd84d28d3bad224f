"""Colour and silhouette: what the pixels say."""

from __future__ import annotations

from torch import Tensor


def photometric(rendered: Tensor, observed: Tensor) -> Tensor:
    """Mean squared error of colours (R, 3). Source: MoCo-Flow sec. 3.2, L_photo."""
    return ((rendered - observed) ** 2).mean()


def silhouette(opacity: Tensor, mask: Tensor) -> Tensor:
    """Mean squared difference of opacity (R,) and mask (R,) in {0, 1}."""
    return ((opacity - mask) ** 2).mean()
