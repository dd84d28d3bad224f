"""Procedural patterns over coordinates in metres; vectorised, evaluated at every sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]

_LATTICE = 32  # Noise repeats after this many cells, far more than a body spans.

_GLYPHS = {
    "4": ("...#.", "..##.", ".#.#.", "#..#.", "#####", "...#.", "...#."),
    "7": ("#####", "....#", "...#.", "..#..", "..#..", ".#...", ".#..."),
}


class Noise:
    """Smooth value noise in [-1, 1], repeatable under its seed."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self._values = random.uniform(-1, 1, (_LATTICE,) * 3).astype(np.float32)

    def __call__(self, points: Array, cell: float | tuple[float, float, float]) -> Array:
        """Noise (N,) at points (N, 3) for cells of the given size, metres."""
        return map_coordinates(
            self._values, (points / np.asarray(cell, np.float32)).T, order=1, mode="grid-wrap"
        )


def stripes(coordinate: Array, period: float) -> Mask:
    """True on every other half period."""
    return (coordinate / period) % 1.0 < 0.5


def checker(u: Array, v: Array, cell: float) -> Mask:
    return (np.floor(u / cell) + np.floor(v / cell)) % 2 < 1


def within(coordinate: Array, low: float, high: float) -> Mask:
    return (coordinate >= low) & (coordinate < high)


def rectangle_outline(u: Array, v: Array, half_u: float, half_v: float, line: float) -> Mask:
    """The border of a rectangle centred on the origin, ``line`` wide, drawn inwards."""
    outside = np.maximum(np.abs(u) - half_u, np.abs(v) - half_v)
    return within(outside, -line, 0.0)


def glyph(character: str, u: Array, v: Array, cell: float) -> Mask:
    """A 5 x 7 bitmap digit centred on the origin, u to the right, v upwards."""
    bitmap = np.array([[c == "#" for c in row] for row in _GLYPHS[character]])
    column = np.floor(u / cell + 2.5).astype(int)
    row = np.floor(3.5 - v / cell).astype(int)
    inside = (column >= 0) & (column < 5) & (row >= 0) & (row < 7)
    return inside & bitmap[np.clip(row, 0, 6), np.clip(column, 0, 4)]


def linear(colour: str) -> Array:
    """A colour ``#rrggbb`` as linear light, (3,)."""
    encoded = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], np.float32) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encode_srgb(light: Array) -> NDArray[np.uint8]:
    """Linear light as sRGB-encoded bytes."""
    light = np.clip(light, 0, 1)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255 * encoded).astype(np.uint8)
