"""LPIPS: distance of two pictures in the features of a network trained to see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.perception.embedded import Weights, embedded_weights

# What the network was trained with: the definition of the score.
SHIFT = (-0.030, -0.088, -0.188)
SCALE = (0.458, 0.448, 0.450)
LEAST_SIDE_PX = 64  # Smaller pictures leave the deep layers with a handful of cells.


class Convolution(NamedTuple):
    """One layer of AlexNet; ``pooled`` where a 3 x 3 maximum in steps of 2 stands before it."""

    stride: int
    padding: int
    pooled: bool


ALEXNET = (
    Convolution(4, 2, False),
    Convolution(1, 2, True),
    Convolution(1, 1, True),
    Convolution(1, 1, False),
    Convolution(1, 1, False),
)


class LpipsAlex:
    """LPIPS with AlexNet and the official linear heads, version 0.1.

    Source: Zhang et al. 2018. Weights and origin: ``perception/weights/NOTICE.md``.
    """

    def __init__(self, weights: Weights | None = None) -> None:
        """``weights``: of the same layers from elsewhere, by ``own_lpips_weights``."""
        chosen = weights or embedded_weights("lpips_alex")
        self.name = "LPIPS-AlexNet-0.1" if weights is None else "LPIPS-AlexNet of the user's own"
        self.digest = chosen.digest
        self._tensors = {name: tensor.float() for name, tensor in chosen.tensors.items()}

    def features(self, picture: NDArray[np.floating]) -> list[Tensor]:
        """Features (C, H, W) of the five layers, each of unit length at every place.

        Args:
            picture: (H, W, 3) in [0, 1]; a shorter side below 64 px is enlarged to it.
        """
        shift, scale = (torch.tensor(row).view(1, 3, 1, 1) for row in (SHIFT, SCALE))
        signed = 2.0 * torch.from_numpy(_enlarged(picture)).permute(2, 0, 1)[None] - 1.0
        found, layer = [], (signed - shift) / scale
        with torch.no_grad():
            for number, step in enumerate(ALEXNET):
                layer = F.max_pool2d(layer, 3, 2) if step.pooled else layer
                weight, bias = (self._tensors[f"conv{number}.{p}"] for p in ("weight", "bias"))
                layer = F.relu(F.conv2d(layer, weight, bias, step.stride, step.padding))
                length = layer.square().sum(dim=1, keepdim=True).sqrt()
                found.append((layer / (length + 1e-10))[0])
        return found

    def distance(self, features: Sequence[Tensor], reference: Sequence[Tensor]) -> float:
        """The score, 0 for equal pictures, from the features of both."""
        total = 0.0
        for number, (ours, theirs) in enumerate(zip(features, reference, strict=True)):
            head = self._tensors[f"lin{number}.weight"].view(-1, 1, 1)
            total += float(((ours - theirs).square() * head).sum(dim=0).mean())
        return total


def lpips_protocol(lpips: LpipsAlex) -> str:
    """Which network compared what."""
    return (
        f"LPIPS: {lpips.name} {lpips.digest[:12]}, a side below {LEAST_SIDE_PX} px enlarged to it"
    )


def _enlarged(picture: NDArray[np.floating]) -> NDArray[np.float32]:
    image = np.ascontiguousarray(picture, np.float32)
    factor = LEAST_SIDE_PX / min(image.shape[:2])
    if factor <= 1.0:
        return image
    size = (round(image.shape[1] * factor), round(image.shape[0] * factor))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.float32)
