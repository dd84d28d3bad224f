"""Colour and silhouette: what the pixels say."""

from __future__ import annotations

from torch import Tensor


def photometric(rendered: Tensor, observed: Tensor, rays: int | None = None) -> Tensor:
    """Mean squared error of colours (R, 3).

    Args:
        rays: over which the mean goes, where these are some of them; their values add up to it.

    Source: MoCo-Flow sec. 3.2, L_photo.
    """
    return _mean((rendered - observed) ** 2, rays)


def silhouette(opacity: Tensor, mask: Tensor, rays: int | None = None) -> Tensor:
    """Mean squared difference of opacity (R,) and mask (R,) in {0, 1}; ``rays`` as above."""
    return _mean((opacity - mask) ** 2, rays)


def _mean(squares: Tensor, rays: int | None) -> Tensor:
    if rays is None:
        return squares.mean()
    return squares.sum() / (rays * squares.shape[1:].numel())
