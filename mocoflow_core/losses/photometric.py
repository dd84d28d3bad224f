"""Colour and silhouette: what the pixels say."""

from __future__ import annotations

from torch import Tensor


def photometric(rendered: Tensor, observed: Tensor, rays: int) -> Tensor:
    """Squared error of colours (R, 3) as a part of the mean over all ``rays`` of a step.

    Source: MoCo-Flow sec. 3.2, L_photo.
    """
    return ((rendered - observed) ** 2).sum() / (rays * rendered.shape[-1])


def silhouette(opacity: Tensor, mask: Tensor, rays: int) -> Tensor:
    """Squared difference of opacity (R,) and mask (R,) in {0, 1}, likewise."""
    return ((opacity - mask) ** 2).sum() / rays
